// The daemon's log on standard error: the only file that knows the logging library, so that no line passes by.
#pragma once

#include <string>
#include <string_view>

namespace nodal::daemon {

enum class LogLevel { kInfo, kError };

/// `level` is "debug", "info", "warning" or "error". Lines are written by a thread of their own: a journal that stalls,
/// or a pipe that nobody reads, must not hold up the rig. What then does not fit is left out, oldest first.
void start_log(const std::string& level);
/// One line: `text` passes printable() here, whatever it was put together from.
void log_line(LogLevel level, std::string_view text);
/// Waits until every line is written; exits at once when nobody reads them.
void end_log(int exit_code);

}  // namespace nodal::daemon
