-- Neovim (0.11 and later): highlight and fold scenes with the grammar and its queries, and print what is seen as JSON.
--
--   nvim --headless -u NONE --cmd 'set noswapfile' -c 'luafile highlight.lua'
--
-- PLSYS_RUNTIME is a folder with parser/plsys.so and queries/plsys/*.scm; PLSYS_SCENES are scenes' paths, one a line.
-- The result has a scene's words with the last capture of each, the levels of its folds, and each query's captures.

local result = { queries = {}, scenes = {} }

local function words_of(buffer)
  local found = {}
  for row, line in ipairs(vim.api.nvim_buf_get_lines(buffer, 0, -1, false)) do
    for column, word in line:gmatch('()([%w_#]+)') do
      local captures = vim.treesitter.get_captures_at_pos(buffer, row - 1, column - 1)
      local last = captures[#captures]
      table.insert(found, { word, last and last.capture or '' })
    end
  end
  return found
end

local function main()
  vim.opt.runtimepath:prepend(vim.env.PLSYS_RUNTIME)
  for path in vim.env.PLSYS_SCENES:gmatch('[^\n]+') do
    vim.cmd('edit! ' .. vim.fn.fnameescape(path))
    local buffer = vim.api.nvim_get_current_buf()
    vim.treesitter.start(buffer, 'plsys')
    vim.treesitter.get_parser(buffer, 'plsys'):parse()
    local levels = {}
    vim.wait(500, function() -- folds are worked out in the background
      levels = {}
      for row = 1, vim.api.nvim_buf_line_count(buffer) do
        table.insert(levels, tonumber(tostring(vim.treesitter.foldexpr(row)):match('%d+')))
      end
      return vim.tbl_contains(levels, 1)
    end, 20)
    table.insert(result.scenes, { words = words_of(buffer), folds = levels })
  end
  for _, name in ipairs({ 'highlights', 'folds', 'indents', 'locals' }) do
    result.queries[name] = vim.treesitter.query.get('plsys', name).captures
  end
end

local fine, failure = pcall(main)
if not fine then result.failure = failure end
io.stdout:write(vim.fn.json_encode(result) .. '\n')
vim.cmd('qall!')
