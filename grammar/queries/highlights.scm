; Colours. What a bare name is, only the vocabulary knows: the lists at the end are generated from it.

(comment) @comment
(string) @string
(number) @number

(name) @variable

; --- keywords

["Selection" "Calculation" "Transformation" "Parameter"] @keyword
["if" "else" "elseif" "elif"] @keyword.conditional
(range "to" @keyword)
["#include" "#declare" "#local"] @keyword.directive
(directive) @keyword.directive
((named_block kind: (name) @keyword) (#eq? @keyword "Texture"))

; --- definitions

(selection name: (name) @type.definition)
(calculation name: (name) @function.definition)
(transformation name: (name) @function.definition)
(named_block name: (name) @type.definition)
(declare name: (name) @constant)
(parameter name: (name) @constant)
(parameters (name) @variable.parameter)

; --- uses

(rule target: (name) @type)
(rule target: (call name: (name) @type))
(operation name: (name) @function.builtin)
(call name: (name) @function.call)
(block name: (name) @type)
(block_body (name) @property)
(map_entry (name) @property)

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
; generated from vocabulary.toml: end
