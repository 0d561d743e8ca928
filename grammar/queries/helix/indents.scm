; Generated from ../indents.scm by ../../generate.py; not edited.

; Indentation: one step inside of brackets, and on the lines that continue a rule.

[
  (selection_body)
  (statements)
  (block_body)
  (braced)
  (group)
  (inline)
  (map_entry)
  (rule)
] @indent

["}" ")" "]"] @outdent

