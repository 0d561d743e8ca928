; Generated from ../folds.scm by ../../generate.py; not edited.

; What folds: everything in braces, groups over several lines, and comments.

[
  (selection)
  (calculation)
  (transformation)
  (named_block)
  (block)
  (braced)
  (group)
  (comment)
] @fold
