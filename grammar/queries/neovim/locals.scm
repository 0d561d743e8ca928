; Generated from ../locals.scm by ../../generate.py; not edited.

; Scopes: a file's definitions are seen everywhere in it; a Selection's parameters only inside of it.

(source_file) @local.scope
(selection) @local.scope

(selection name: (name) @local.definition.type)
(calculation name: (name) @local.definition.function)
(transformation name: (name) @local.definition.function)
(named_block name: (name) @local.definition.type)
(declare name: (name) @local.definition.constant)
(parameter name: (name) @local.definition.constant)
(parameters (name) @local.definition.parameter)

(name) @local.reference
