"""A scene of which some is regular subdivision and some isn't, for the tests of terrains.

    from wooded_hills import WOODED
    data = compile(WOODED, parameters={"level": 4})
"""

from __future__ import annotations

from pathlib import Path

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "terrain.plsys"

# Beside hills: trees on them, found by the same subdivision, more hills after these, and shapes.
WOODED = (
    SCENE.read_text().replace("object { Hills }", """
sphere { <20, 20, 4>, 3 }
object { Woods }
object { Hills texture { pigment { color rgb 1 } } no_shadow }
object { Woods translate <3, 2, 4> }
object { Hills scale <0.5, 0.5, 0.2> translate <-20, 10, 0> }
box { <30, 5, 0>, <34, 9, 6> texture { pigment { color rgb <1, 0, 0> } } }
""")
    + """
Selection Woods { Woods -> Wood(2, relief, 0, 0, -3, 64, 0, -3, 64, 64, 8) + Wood(2, relief, 64, 64, 8, 0, 64, 1, 0, 0, -3); }
Selection Wood(n, rough, xa, ya, za, xb, yb, zb, xc, yc, zc)
{
    if (n > 0)
        Wood -> C_middles ( Wood(n - 1, rough / 2, xa, ya, za, xab, yab, zab, xca, yca, zca)
                          + Wood(n - 1, rough / 2, xab, yab, zab, xb, yb, zb, xbc, ybc, zbc)
                          + Wood(n - 1, rough / 2, xca, yca, zca, xbc, ybc, zbc, xc, yc, zc) );
    else
        Wood -> [ trans xa ya za ] Tree(4);
}
Selection Tree(k)
{
    if (k > 0) Tree -> Bark [ scale 0.3 0.3 3 ] cylinder + [ trans 0 0 3; roty 35; scale 0.75 ] Tree(k - 1) + [ trans 0 0 3; roty -35; rotz 80; scale 0.7 ] Tree(k - 1);
    else       Tree -> sphere;
}
Texture Bark { pigment { color rgb <0.4, 0.3, k/4> } }
"""
)  # fmt: skip
