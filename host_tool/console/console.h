// The output to the user: answers on standard output, everything else on standard error, colour only on
// a terminal.
#pragma once

#include <cstdint>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

/// Keys stay in the order they were written in.
using Json = nlohmann::ordered_json;

enum class Colour { kGood, kWarning, kBad, kDim, kStrong };

/// Threading: thread-bound.
/// Ownership: the streams are not closed.
/// Errors: what standard output refuses is kept, and said once by end_output(). Commands that go on for long look at
///   output_gone() and end.
class Console {
 public:
  Console(std::FILE* out, std::FILE* err);

  void set_json(bool json) { json_ = json; }
  bool json() const { return json_; }
  bool out_is_terminal() const { return out_terminal_; }
  bool err_is_terminal() const { return err_terminal_; }
  /// Whether a write to standard output failed: the rest of the answer is of no use.
  bool output_gone() const { return output_error_ != 0; }
  /// Writes what is buffered and learns what the file system reports at close. 0, or the errno of the first write to
  /// standard output that failed. Call it last.
  int end_output();

  /// Answers, for people: a line on standard output. Nothing when --json was asked for.
  void line(std::string_view text);
  /// Answers, for programs: one JSON document on one line of standard output. Nothing without --json.
  void document(const Json& document);
  /// Bytes on standard output as they are, with --json, too: pictures of `raymap pull --out -`, the text of --help.
  void bytes(std::string_view data);

  /// Remarks on standard error: what was done on the way, notes, warnings.
  void note(std::string_view text);
  void warning(std::string_view text);
  /// The error of a command that failed; with --json also as {"error": {...}} on standard output.
  void error(const Error& error);
  /// What error() writes to standard error, and with --json to standard output; for a signal handler.
  std::string error_text(const Error& error) const;
  std::string error_document(const Error& error) const;

  /// The text in colour when standard output is a terminal and NO_COLOR is not set.
  std::string paint(Colour colour, std::string_view text) const;

  /// Clears the terminal's screen from the top, for a display that is drawn again and again.
  void home();

  /// A line on standard error that is drawn over, as progress is; ends with finish_progress().
  void progress(std::string_view text);
  void finish_progress();
  /// The rig's current activity, when it changed.
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
  std::string activity_;
};

/// Columns of text, each as wide as its widest cell; numbers to the right.
class Table {
 public:
  enum class Align { kLeft, kRight };
  struct Column {
    std::string title;
    Align align = Align::kLeft;
  };
  explicit Table(std::vector<Column> columns) : columns_(std::move(columns)) {}
  void row(std::vector<std::string> cells);
  /// One line a row, the titles first.
  std::vector<std::string> lines() const;

 private:
  std::vector<Column> columns_;
  std::vector<std::vector<std::string>> rows_;
};

/// How far a job has come: a bar that is redrawn on a terminal, a line every few seconds elsewhere.
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
  std::int64_t last_ns_;
};

}  // namespace nodal::host
