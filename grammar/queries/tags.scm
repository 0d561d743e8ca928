; Outline and navigation: what a file defines, and where it is used.

(selection name: (name) @name) @definition.class
(calculation name: (name) @name) @definition.function
(transformation name: (name) @name) @definition.function
(named_block name: (name) @name) @definition.class
(declare name: (name) @name) @definition.constant
(parameter name: (name) @name) @definition.constant

(term (name) @name) @reference.call
(term (call name: (name) @name)) @reference.call
(block_body (name) @name) @reference.call
