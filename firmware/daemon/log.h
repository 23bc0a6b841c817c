// The daemon's log on standard error. Only this module uses the logging library, so that every line is sanitised here.
#pragma once

#include <string>
#include <string_view>

namespace nodal::daemon {

enum class LogLevel { kInfo, kError };

/// `level` is "debug", "info", "warning" or "error". A separate thread writes the lines, so that a journal or pipe that
/// blocks does not block the rig. When its queue is full, the oldest lines are discarded.
void start_log(const std::string& level);
/// Writes one line; `text` passes printable().
void log_line(LogLevel level, std::string_view text);
/// Waits until every line is written; ends the process at once if standard error blocks for 1 s.
void end_log(int exit_code);

}  // namespace nodal::daemon
