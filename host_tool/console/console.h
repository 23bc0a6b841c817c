// The output to the user: results on standard output, everything else on standard error, colour only on a
// terminal.
#pragma once

#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/fit_text.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// Keeps keys in insertion order.
using Json = nlohmann::ordered_json;

enum class Colour { kGood, kWarning, kBad, kDim, kStrong };

/// Threading: thread-bound.
/// Ownership: the streams are not closed.
/// Errors: the first failed write to standard output is stored; end_output() reports it once. Long-running commands
///   check output_gone() and stop.
class Console {
 public:
  Console(std::FILE* out, std::FILE* err);

  void set_json(bool json) { json_ = json; }
  bool json() const { return json_; }
  bool out_is_terminal() const { return out_terminal_; }
  bool err_is_terminal() const { return err_terminal_; }
  /// Whether a write to standard output failed: writing more results is pointless.
  bool output_gone() const { return output_error_ != 0; }
  /// Writes buffered data and gets errors that the file system reports at close. Returns 0, or the errno of the first
  /// failed write to standard output. Call it last.
  int end_output();

  /// A result for human readers: one line on standard output, broken where a terminal ends; an end of a line in `text`
  /// is replaced. Does nothing with --json.
  void line(std::string_view text);
  /// A result for programs: one JSON document on one line of standard output. Does nothing without --json.
  void document(const Json& document);
  /// The text of --help, also with --json; broken where a terminal ends.
  void help(const std::string& text);
  /// Unmodified bytes on standard output, also with --json: pictures of `raymap pull --out -`.
  void bytes(std::string_view data);

  /// Remarks on standard error: progress, notes, warnings. One line each, as line().
  void note(std::string_view text);
  void warning(std::string_view text);
  /// The error of a command that failed; with --json also as {"error": {...}} on standard output.
  void error(const Error& error);
  /// The text that error() writes to standard error, and with --json to standard output; for a signal handler.
  std::string error_text(const Error& error) const;
  std::string error_document(const Error& error) const;

  /// The text in colour if standard output is a terminal and NO_COLOR is not set.
  std::string paint(Colour colour, std::string_view text) const;

  /// Asks a question, and returns whether the answer is yes. Returns true without asking if standard input or standard
  /// error is no terminal, and with --json: scripts are not asked.
  bool confirmed(std::string_view question);

  /// Clears the terminal's screen from the top, for a display that is redrawn repeatedly. Lines that have no room on
  /// the screen are not printed until foot(), which says how many there were, and `text`.
  void home();
  void foot(std::string_view text);

  /// A line on standard error that is overwritten, for progress; finish_progress() ends it.
  void progress(std::string_view text);
  void finish_progress();
  /// Shows the rig's present activity if it changed.
  void activity(const std::string& text);

 private:
  std::string paint_for(bool terminal, Colour colour, std::string_view text) const;

  std::FILE* out_;
  std::FILE* err_;
  int output_error_ = 0;
  bool out_terminal_;
  bool err_terminal_;
  bool colour_;
  bool json_ = false;
  bool progress_shown_ = false;
  std::optional<std::size_t> room_;  ///< lines of the screen that are left, after home()
  std::size_t cut_ = 0;              ///< lines that had no room
  std::string activity_;
};

/// Columns of text, each as wide as its widest cell; numbers are right-aligned.
class Table {
 public:
  enum class Align { kLeft, kRight };
  struct Column {
    std::string title;
    Align align = Align::kLeft;
  };
  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}
  void row(std::vector<std::string> cells);
  /// One line per row, the titles first.
  std::vector<std::string> lines() const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

/// The progress of a job, in percent and with the time that is left: a bar that is redrawn on a terminal, a line every
/// few seconds elsewhere.
class Progress {
 public:
  /// `total` 0: the total is unknown.
  Progress(Console& console, std::string what, std::uint64_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  void update(std::uint64_t done, std::string_view remark);

 private:
  Console& console_;
  std::string what_;
  std::uint64_t total_;
  std::int64_t begun_ns_;
  std::int64_t last_ns_;
};

}  // namespace nodal::host
