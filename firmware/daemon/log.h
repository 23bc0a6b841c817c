// The daemon's log on standard error. Only this module uses the logging library, so that every line is sanitised here.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal::daemon {

enum class LogLevel : std::uint8_t { kTrace, kDebug, kInfo, kWarning, kError };

/// What a line is about; each has a level of its own.
enum class LogCategory : std::uint8_t {
  kRig,      ///< all that has no category below
  kCapture,  ///< heads as the rig sees them: debug: openings, settings, bad frames; trace: every frame
  kV4l2,     ///< trace: every call to a V4L2 driver
  kIidc,     ///< trace: every register and frame of an IIDC camera
  kGpio,     ///< trace: every call to a GPIO line
};
inline constexpr std::size_t kLogCategories = 5;

/// The lowest level of each category that is written.
struct LogLevels {
  std::array<LogLevel, kLogCategories> of{LogLevel::kInfo, LogLevel::kInfo, LogLevel::kInfo, LogLevel::kInfo,
                                          LogLevel::kInfo};

  /// "debug" for all categories, "capture=debug" for one, or several of these with commas, of which later ones replace
  /// earlier ones. Errors: kBadValue, which names the levels or the categories that there are.
  static Result<LogLevels> parse(std::string_view text);
};

/// A separate thread writes the lines, so that a journal or pipe that blocks does not block the rig. When its queue is
/// full, the oldest lines are discarded; end_log() writes how many.
void start_log(const LogLevels& levels);
/// Whether lines of this category and level are written. Any thread.
bool logs(LogCategory category, LogLevel level);
/// Writes one line, if its category and level are written; `text` passes printable(). Any thread.
void log_line(LogCategory category, LogLevel level, std::string_view text);
inline void log_line(LogLevel level, std::string_view text) { log_line(LogCategory::kRig, level, text); }
/// Waits until every line is written; ends the process at once if standard error blocks for 1 s.
void end_log(int exit_code);

}  // namespace nodal::daemon
