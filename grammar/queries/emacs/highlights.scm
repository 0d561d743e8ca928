; Generated from ../highlights.scm by ../../generate.py; not edited.

; For treesit-font-lock-rules with :override t: the last pattern that fits a name counts.

; Colours. What a bare name is, only the vocabulary knows: the lists at the end are generated from it.

(comment) @font-lock-comment-face
(string) @font-lock-string-face
(number) @font-lock-number-face

(name) @font-lock-variable-use-face

; --- keywords

["Selection" "Calculation" "Transformation" "Parameter"] @font-lock-keyword-face
["if" "else" "elseif" "elif"] @font-lock-keyword-face
(range "to" @font-lock-keyword-face)
["#include" "#declare" "#local"] @font-lock-preprocessor-face
(directive) @font-lock-preprocessor-face
((named_block kind: (name) @font-lock-keyword-face) (#equal @font-lock-keyword-face "Texture"))

; --- definitions

(selection name: (name) @font-lock-type-face)
(calculation name: (name) @font-lock-function-name-face)
(transformation name: (name) @font-lock-function-name-face)
(named_block name: (name) @font-lock-type-face)
(declare name: (name) @font-lock-constant-face)
(parameter name: (name) @font-lock-constant-face)
(parameters (name) @font-lock-variable-name-face)

; --- uses

(rule target: (name) @font-lock-type-face)
(rule target: (call name: (name) @font-lock-type-face))
(operation name: (name) @font-lock-builtin-face)
(call name: (name) @font-lock-function-call-face)
(block name: (name) @font-lock-type-face)
(block_body (name) @font-lock-property-name-face)
(map_entry (name) @font-lock-property-name-face)

; --- punctuation

(arrow) @font-lock-operator-face
(binary operator: _ @font-lock-operator-face)
(unary operator: _ @font-lock-operator-face)
(assignment operator: _ @font-lock-operator-face)
(step operator: _ @font-lock-operator-face)
(union "+" @font-lock-operator-face)
(rule "|" @font-lock-operator-face)
(conditional ["?" ":"] @font-lock-operator-face)
["{" "}" "(" ")" "[" "]"] @font-lock-bracket-face
(vector ["<" ">"] @font-lock-bracket-face)
["," ";"] @font-lock-delimiter-face

; generated from vocabulary.toml: begin
((name) @font-lock-constant-face
  (#match "^\\(?:pi\\)$" @font-lock-constant-face))
((name) @font-lock-builtin-face
  (#match "^\\(?:abs\\|sign\\|floor\\|ceil\\|round\\|min\\|max\\|clamp\\|mix\\|pow\\|exp\\|log\\|sqrt\\|sin\\|cos\\|tan\\|asin\\|acos\\|atan2\\|rand\\|hash\\|trans\\|rotx\\|roty\\|rotz\\|rot\\|scale\\|shear\\|matrix\\|variants\\)$" @font-lock-builtin-face))
((name) @font-lock-builtin-face
  (#match "^\\(?:sphere\\|cylinder\\|cone\\|box\\|torus\\|triangle\\|square\\|disc\\|mesh\\|global_settings\\|background\\|camera\\|light_source\\|object\\|union\\|plane\\|smooth_triangle\\|texture\\|pigment\\|finish\\|color_map\\)$" @font-lock-builtin-face))
([(block_body (name) @font-lock-property-name-face) (map_entry (name) @font-lock-property-name-face) (declare value: (name) @font-lock-property-name-face)]
  (#match "^\\(?:assumed_gamma\\|max_trace_level\\|adc_bailout\\|ambient_light\\|seed\\|color\\|location\\|direction\\|right\\|up\\|sky\\|look_at\\|angle\\|perspective\\|parallel\\|spotlight\\|shadowless\\|point_at\\|radius\\|falloff\\|tightness\\|fade_distance\\|fade_power\\|checker\\|gradient\\|color_map\\|ambient\\|emission\\|diffuse\\|brilliance\\|phong\\|phong_size\\|specular\\|roughness\\|reflection\\|translate\\|rotate\\|scale\\|matrix\\|texture\\|pigment\\|finish\\|no_shadow\\|rgb\\|rgbf\\|rgbt\\|rgbft\\|colour\\|red\\|green\\|blue\\|filter\\|transmit\\)$" @font-lock-property-name-face))
((name) @font-lock-constant-face
  (#match "^\\(?:Red\\|Green\\|Blue\\|Yellow\\|Cyan\\|Magenta\\|Clear\\|White\\|Black\\|Gray05\\|Gray10\\|Gray15\\|Gray20\\|Gray25\\|Gray30\\|Gray35\\|Gray40\\|Gray45\\|Gray50\\|Gray55\\|Gray60\\|Gray65\\|Gray70\\|Gray75\\|Gray80\\|Gray85\\|Gray90\\|Gray95\\|DimGray\\|DimGrey\\|Gray\\|Grey\\|LightGray\\|LightGrey\\|VLightGray\\|VLightGrey\\|Aquamarine\\|BlueViolet\\|Brown\\|CadetBlue\\|Coral\\|CornflowerBlue\\|DarkGreen\\|DarkOliveGreen\\|DarkOrchid\\|DarkSlateBlue\\|DarkSlateGray\\|DarkSlateGrey\\|DarkTurquoise\\|Firebrick\\|ForestGreen\\|Gold\\|Goldenrod\\|GreenYellow\\|IndianRed\\|Khaki\\|LightBlue\\|LightSteelBlue\\|LimeGreen\\|Maroon\\|MediumAquamarine\\|MediumBlue\\|MediumForestGreen\\|MediumGoldenrod\\|MediumOrchid\\|MediumSeaGreen\\|MediumSlateBlue\\|MediumSpringGreen\\|MediumTurquoise\\|MediumVioletRed\\|MidnightBlue\\|Navy\\|NavyBlue\\|Orange\\|OrangeRed\\|Orchid\\|PaleGreen\\|Pink\\|Plum\\|Salmon\\|SeaGreen\\|Sienna\\|SkyBlue\\|SlateBlue\\|SpringGreen\\|SteelBlue\\|Tan\\|Thistle\\|Turquoise\\|Violet\\|VioletRed\\|Wheat\\|YellowGreen\\|SummerSky\\|RichBlue\\|Brass\\|Copper\\|Bronze\\|Bronze2\\|Silver\\|BrightGold\\|OldGold\\|Feldspar\\|Quartz\\|Mica\\|NeonPink\\|DarkPurple\\|NeonBlue\\|CoolCopper\\|MandarinOrange\\|LightWood\\|MediumWood\\|DarkWood\\|SpicyPink\\|SemiSweetChoc\\|BakersChoc\\|Flesh\\|NewTan\\|NewMidnightBlue\\|VeryDarkBrown\\|DarkBrown\\|DarkTan\\|GreenCopper\\|DkGreenCopper\\|DustyRose\\|HuntersGreen\\|Scarlet\\|Med_Purple\\|Light_Purple\\|Very_Light_Purple\\)$" @font-lock-constant-face))
; generated from vocabulary.toml: end
