"""The language server: `plsys lsp`. See README.md for the contract that features follow."""
