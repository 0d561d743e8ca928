/* render.h - the picture: pl_render of plsys.h, tiles on all cores.
 *
 * Threads take tiles in order from one counter. Every pixel is computed from the scene and the options alone, so the
 * picture has the same bits whatever the threads do; of several errors the one that comes first in tile order wins,
 * as if one thread had done it all. The calling thread works too and alone calls the progress function. */
#ifndef PL_RENDER_H
#define PL_RENDER_H

enum { PL_LIMIT_SIDE = 1 << 16 }; /* pixels of a picture's side */

#endif
