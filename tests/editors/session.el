;;; session.el --- Emacs with eglot: what the language server gives, printed as JSON  -*- lexical-binding: t -*-

;; emacs -q --batch -l session.el
;;
;; PLSYS_SERVER is the server's command (words apart by spaces), PLSYS_SCENE the scene's path.  The scene misspells Tree
;; in its first line; the session sees that, completes and hovers, renames T_up and mends the line.

(require 'package)
(package-initialize)
(require 'cl-lib)
(require 'json)
(require 'eglot)
(require 'flymake)

(define-derived-mode plsys-mode prog-mode "plsys"
  (setq-local comment-start "// "))

(defvar session-result nil)
(defun session-note (key value)
  (push (cons key value) session-result))

(defun session-wait (ready)
  "Let the server work until READY returns non-nil, for at most 20 seconds."
  (let ((end (+ (float-time) 20)) value)
    (while (and (not (setq value (funcall ready))) (< (float-time) end))
      (accept-process-output nil 0.05))
    value))

(defun session-codes ()
  "The codes in the messages that flymake shows."
  (mapcar (lambda (each) (substring-no-properties (flymake-diagnostic-text each))) (flymake-diagnostics)))

(defun session-ask (method &rest more)
  (jsonrpc-request (eglot--current-server-or-lose) method
                   (append (eglot--TextDocumentPositionParams) more)))

(defun session-run ()
  (add-to-list 'eglot-server-programs (cons 'plsys-mode (split-string (getenv "PLSYS_SERVER") " ")))
  (setq eglot-sync-connect 20 eglot-autoshutdown t make-backup-files nil)
  (find-file (getenv "PLSYS_SCENE"))
  (plsys-mode)
  (apply #'eglot--connect (eglot--guess-contact))
  (eglot--maybe-activate-editing-mode)
  (session-wait (lambda () (flymake-start) (flymake-diagnostics)))
  (session-note 'diagnostics (vconcat (session-codes)))
  (goto-char (point-min))
  (search-forward "T_u")
  (let* ((answer (session-ask :textDocument/completion))
         (items (if (vectorp answer) answer (plist-get answer :items))))
    (session-note 'completion (vconcat (mapcar (lambda (item) (plist-get item :label)) items))))
  (session-note 'hover (plist-get (plist-get (session-ask :textDocument/hover) :contents) :value))
  (eglot-rename "T_high")
  (session-note 'renamed (vconcat (split-string (buffer-string) "\n")))
  (goto-char (point-min))
  (search-forward "Tre ")
  (replace-match "Tree " t t)
  (eglot--signal-textDocument/didChange)
  (session-wait (lambda () (flymake-start)
                  (not (cl-some (lambda (text) (string-match-p "unknown name" text)) (session-codes)))))
  (session-note 'mended (vconcat (session-codes))))

(condition-case failure
    (session-run)
  (error (session-note 'failure (format "%S" failure))))
(session-note 'version emacs-version)
(princ (concat (json-encode session-result) "\n"))
(set-buffer-modified-p nil)
(kill-emacs 0)
