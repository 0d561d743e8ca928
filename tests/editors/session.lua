-- Neovim (0.7 and later): open a scene with the language server, and print what it gives as JSON.
--
--   nvim --headless -u NONE --cmd 'set noswapfile' -c 'luafile session.lua'
--
-- PLSYS_SERVER is the server's command (words apart by spaces), PLSYS_SCENE the scene's path. The scene misspells Tree
-- in its first line; the session sees that, completes and hovers, renames Tree and mends the line.

local server = vim.split(vim.env.PLSYS_SERVER, ' ')
local result = { version = vim.version().major .. '.' .. vim.version().minor }

local function finish()
  io.stdout:write(vim.fn.json_encode(result) .. '\n')
  vim.cmd('qall!')
end

local function main()
  vim.cmd('edit ' .. vim.fn.fnameescape(vim.env.PLSYS_SCENE))
  local buffer = vim.api.nvim_get_current_buf()
  local id = vim.lsp.start_client({ name = 'plsys', cmd = server, root_dir = vim.fn.getcwd() })
  vim.lsp.buf_attach_client(buffer, id)
  local function ready() return #vim.diagnostic.get(buffer) > 0 end
  vim.wait(20000, ready, 20)

  result.diagnostics = {}
  for _, each in ipairs(vim.diagnostic.get(buffer)) do
    table.insert(result.diagnostics, { line = each.lnum, code = each.code, message = each.message, severity = each.severity })
  end

  local function ask(method, line, character, more)
    local params = vim.tbl_extend('force', {
      textDocument = vim.lsp.util.make_text_document_params(buffer),
      position = { line = line, character = character },
    }, more or {})
    local answers, failure = vim.lsp.buf_request_sync(buffer, method, params, 20000)
    local answer = answers and answers[id] or { error = failure }
    return answer.result, answer.error
  end

  -- The middle of the rule in line 2: `Selection Tree { Tree -> T_up cylinder; }`.
  local line = vim.api.nvim_buf_get_lines(buffer, 1, 2, false)[1]
  local completed = ask('textDocument/completion', 1, line:find('T_up') - 1 + 2) or {}
  result.completion = {}
  for _, item in ipairs(completed.items or completed) do table.insert(result.completion, item.label) end
  local hover = ask('textDocument/hover', 1, line:find('T_up') - 1 + 1)
  result.hover = hover and hover.contents
  local edit = ask('textDocument/rename', 1, line:find('T_up') - 1 + 1, { newName = 'T_high' })
  if edit then vim.lsp.util.apply_workspace_edit(edit, 'utf-16') end
  result.renamed = vim.api.nvim_buf_get_lines(buffer, 0, -1, false)

  vim.api.nvim_buf_set_lines(buffer, 0, 1, false, { 'object { Tree }' })
  vim.wait(20000, function()
    for _, each in ipairs(vim.diagnostic.get(buffer)) do
      if each.code == 'unknown-name' then return false end
    end
    return true
  end, 20)
  result.mended = {}
  for _, each in ipairs(vim.diagnostic.get(buffer)) do table.insert(result.mended, each.code) end
  vim.lsp.stop_client(id)
end

local ok, failure = pcall(main)
if not ok then result.failure = failure end
finish()
