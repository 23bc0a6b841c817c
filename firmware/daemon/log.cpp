#include "firmware/daemon/log.h"

#include <fmt/format.h>
#include <poll.h>
#include <spdlog/async.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <span>
#include <utility>

#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::daemon {
namespace {

constexpr std::size_t kQueuedLines = 512;
constexpr std::size_t kTracedLines = 8192;  ///< a trace of ten heads writes about 1000 lines a second
constexpr std::size_t kLongestLine = 1024;  ///< bytes; the rest is cut off
constexpr int kFarewellPatience_ms = 1000;

constexpr std::array<std::string_view, 5> kLevelNames{"trace", "debug", "info", "warning", "error"};
constexpr std::array<std::string_view, kLogCategories> kCategoryNames{"rig", "capture", "v4l2", "iidc", "gpio"};
constexpr std::array kLibraryLevels{spdlog::level::trace, spdlog::level::debug, spdlog::level::info,
                                    spdlog::level::warn, spdlog::level::err};

/// Written before the rig's threads start.
LogLevels written_levels;

std::size_t index_of(LogCategory category) { return static_cast<std::size_t>(category); }

Result<std::size_t> find_name(std::span<const std::string_view> names, std::string_view name, std::string_view what) {
  const auto found = std::ranges::find(names, name);
  if (found != names.end()) return static_cast<std::size_t>(found - names.begin());
  return fail(Errc::kBadValue,
              fmt::format("--log: there is no {} '{}'; there are {}", what, name, fmt::join(names, ", ")));
}

}  // namespace

Result<LogLevels> LogLevels::parse(std::string_view text) {
  LogLevels levels;
  while (true) {
    const std::size_t comma = text.find(',');
    const std::string_view word = text.substr(0, comma);
    const std::size_t equals = word.find('=');
    NODAL_TRY_ASSIGN(
        const auto level,
        find_name(kLevelNames, equals == std::string_view::npos ? word : word.substr(equals + 1), "level"));
    if (equals == std::string_view::npos) {
      levels.of.fill(static_cast<LogLevel>(level));
    } else {
      NODAL_TRY_ASSIGN(const auto category, find_name(kCategoryNames, word.substr(0, equals), "category"));
      levels.of[category] = static_cast<LogLevel>(level);
    }
    if (comma == std::string_view::npos) return levels;
    text.remove_prefix(comma + 1);
  }
}

void start_log(const LogLevels& levels) {
  written_levels = levels;
  const LogLevel lowest = *std::ranges::min_element(levels.of);
  spdlog::init_thread_pool(lowest == LogLevel::kTrace ? kTracedLines : kQueuedLines, 1);
  auto logger = spdlog::create_async_nb<spdlog::sinks::stderr_color_sink_mt>("nodald");
  // Under systemd the journal adds the time.
  logger->set_pattern(std::getenv("JOURNAL_STREAM") ? "%l: %v" : "%Y-%m-%d %H:%M:%S.%e %^%l%$: %v");
  logger->set_level(spdlog::level::trace);  // log_line() decides
  logger->flush_on(spdlog::level::debug);
  spdlog::set_default_logger(std::move(logger));
}

bool logs(LogCategory category, LogLevel level) { return level >= written_levels.of[index_of(category)]; }

void log_line(LogCategory category, LogLevel level, std::string_view text) {
  if (!logs(category, level)) return;
  const spdlog::level::level_enum as = kLibraryLevels[static_cast<std::size_t>(level)];
  if (category == LogCategory::kRig) {
    spdlog::log(as, "{}", printable(text, kLongestLine));
  } else {
    spdlog::log(as, "{}: {}", kCategoryNames[index_of(category)], printable(text, kLongestLine));
  }
}

void end_log(int exit_code) {
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&out, 1, kFarewellPatience_ms) == 0) ::_exit(exit_code);
  if (const std::size_t discarded = spdlog::thread_pool() ? spdlog::thread_pool()->overrun_counter() : 0;
      discarded > 0) {
    log_line(
        LogLevel::kWarning,
        fmt::format("{} lines of this log were discarded, because standard error took them too slowly", discarded));
  }
  spdlog::shutdown();
}

}  // namespace nodal::daemon
