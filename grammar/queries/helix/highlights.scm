; Generated from ../highlights.scm by ../../generate.py; not edited.

; Colours. What a bare name is, only the vocabulary knows: the lists at the end are generated from it.

(comment) @comment
(string) @string
(number) @constant.numeric

(name) @variable

; --- keywords

["Selection" "Calculation" "Transformation" "Parameter"] @keyword
["if" "else" "elseif" "elif"] @keyword.control.conditional
(range "to" @keyword)
["#include" "#declare" "#local"] @keyword.directive
(directive) @keyword.directive
((named_block kind: (name) @keyword) (#eq? @keyword "Texture"))

; --- definitions

(selection name: (name) @type)
(calculation name: (name) @function)
(transformation name: (name) @function)
(named_block name: (name) @type)
(declare name: (name) @constant)
(parameter name: (name) @constant)
(parameters (name) @variable.parameter)

; --- uses

(rule target: (name) @type)
(rule target: (call name: (name) @type))
(operation name: (name) @function.builtin)
(call name: (name) @function)
(block name: (name) @type)
(block_body (name) @variable.other.member)
(map_entry (name) @variable.other.member)

; --- punctuation

(arrow) @operator
(binary operator: _ @operator)
(unary operator: _ @operator)
(assignment operator: _ @operator)
(step operator: _ @operator)
(union "+" @operator)
(rule "|" @operator)
(conditional ["?" ":"] @operator)
["{" "}" "(" ")" "[" "]"] @punctuation.bracket
(vector ["<" ">"] @punctuation.bracket)
["," ";"] @punctuation.delimiter

; generated from vocabulary.toml: begin
((name) @constant.builtin
  (#any-of? @constant.builtin
    "pi"
  ))
((name) @function.builtin
  (#any-of? @function.builtin
    "abs"
    "sign"
    "floor"
    "ceil"
    "round"
    "min"
    "max"
    "clamp"
    "mix"
    "pow"
    "exp"
    "log"
    "sqrt"
    "sin"
    "cos"
    "tan"
    "asin"
    "acos"
    "atan2"
    "rand"
    "hash"
    "trans"
    "rotx"
    "roty"
    "rotz"
    "rot"
    "scale"
    "shear"
    "matrix"
    "variants"
  ))
((name) @type.builtin
  (#any-of? @type.builtin
    "sphere"
    "cylinder"
    "cone"
    "box"
    "torus"
    "triangle"
    "square"
    "disc"
    "mesh"
    "global_settings"
    "background"
    "camera"
    "light_source"
    "object"
    "union"
    "plane"
    "smooth_triangle"
    "texture"
    "pigment"
    "finish"
    "color_map"
  ))
([(block_body (name) @variable.other.member) (map_entry (name) @variable.other.member) (declare value: (name) @variable.other.member)]
  (#any-of? @variable.other.member
    "assumed_gamma"
    "max_trace_level"
    "adc_bailout"
    "ambient_light"
    "seed"
    "color"
    "location"
    "direction"
    "right"
    "up"
    "sky"
    "look_at"
    "angle"
    "perspective"
    "parallel"
    "spotlight"
    "shadowless"
    "point_at"
    "radius"
    "falloff"
    "tightness"
    "fade_distance"
    "fade_power"
    "checker"
    "gradient"
    "color_map"
    "ambient"
    "emission"
    "diffuse"
    "brilliance"
    "phong"
    "phong_size"
    "specular"
    "roughness"
    "reflection"
    "translate"
    "rotate"
    "scale"
    "matrix"
    "texture"
    "pigment"
    "finish"
    "no_shadow"
    "rgb"
    "rgbf"
    "rgbt"
    "rgbft"
    "colour"
    "red"
    "green"
    "blue"
    "filter"
    "transmit"
  ))
((name) @constant.builtin
  (#any-of? @constant.builtin
    "Red"
    "Green"
    "Blue"
    "Yellow"
    "Cyan"
    "Magenta"
    "Clear"
    "White"
    "Black"
    "Gray05"
    "Gray10"
    "Gray15"
    "Gray20"
    "Gray25"
    "Gray30"
    "Gray35"
    "Gray40"
    "Gray45"
    "Gray50"
    "Gray55"
    "Gray60"
    "Gray65"
    "Gray70"
    "Gray75"
    "Gray80"
    "Gray85"
    "Gray90"
    "Gray95"
    "DimGray"
    "DimGrey"
    "Gray"
    "Grey"
    "LightGray"
    "LightGrey"
    "VLightGray"
    "VLightGrey"
    "Aquamarine"
    "BlueViolet"
    "Brown"
    "CadetBlue"
    "Coral"
    "CornflowerBlue"
    "DarkGreen"
    "DarkOliveGreen"
    "DarkOrchid"
    "DarkSlateBlue"
    "DarkSlateGray"
    "DarkSlateGrey"
    "DarkTurquoise"
    "Firebrick"
    "ForestGreen"
    "Gold"
    "Goldenrod"
    "GreenYellow"
    "IndianRed"
    "Khaki"
    "LightBlue"
    "LightSteelBlue"
    "LimeGreen"
    "Maroon"
    "MediumAquamarine"
    "MediumBlue"
    "MediumForestGreen"
    "MediumGoldenrod"
    "MediumOrchid"
    "MediumSeaGreen"
    "MediumSlateBlue"
    "MediumSpringGreen"
    "MediumTurquoise"
    "MediumVioletRed"
    "MidnightBlue"
    "Navy"
    "NavyBlue"
    "Orange"
    "OrangeRed"
    "Orchid"
    "PaleGreen"
    "Pink"
    "Plum"
    "Salmon"
    "SeaGreen"
    "Sienna"
    "SkyBlue"
    "SlateBlue"
    "SpringGreen"
    "SteelBlue"
    "Tan"
    "Thistle"
    "Turquoise"
    "Violet"
    "VioletRed"
    "Wheat"
    "YellowGreen"
    "SummerSky"
    "RichBlue"
    "Brass"
    "Copper"
    "Bronze"
    "Bronze2"
    "Silver"
    "BrightGold"
    "OldGold"
    "Feldspar"
    "Quartz"
    "Mica"
    "NeonPink"
    "DarkPurple"
    "NeonBlue"
    "CoolCopper"
    "MandarinOrange"
    "LightWood"
    "MediumWood"
    "DarkWood"
    "SpicyPink"
    "SemiSweetChoc"
    "BakersChoc"
    "Flesh"
    "NewTan"
    "NewMidnightBlue"
    "VeryDarkBrown"
    "DarkBrown"
    "DarkTan"
    "GreenCopper"
    "DkGreenCopper"
    "DustyRose"
    "HuntersGreen"
    "Scarlet"
    "Med_Purple"
    "Light_Purple"
    "Very_Light_Purple"
  ))
; generated from vocabulary.toml: end
