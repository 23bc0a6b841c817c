#include "firmware/daemon/log.h"

#include <poll.h>
#include <spdlog/async.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdlib>
#include <utility>

#include "protocol/base/text.h"

namespace nodal::daemon {
namespace {

constexpr std::size_t kQueuedLines = 512;
constexpr std::size_t kLongestLine = 1024;  ///< bytes; the rest is cut off
constexpr int kFarewellPatience_ms = 1000;

}  // namespace

void start_log(const std::string& level) {
  spdlog::init_thread_pool(kQueuedLines, 1);
  auto logger = spdlog::create_async_nb<spdlog::sinks::stderr_color_sink_mt>("nodald");
  // Under systemd the journal adds the time.
  logger->set_pattern(std::getenv("JOURNAL_STREAM") ? "%l: %v" : "%Y-%m-%d %H:%M:%S.%e %^%l%$: %v");
  logger->set_level(spdlog::level::from_str(level));
  logger->flush_on(spdlog::level::debug);
  spdlog::set_default_logger(std::move(logger));
}

void log_line(LogLevel level, std::string_view text) {
  spdlog::log(level == LogLevel::kError ? spdlog::level::err : spdlog::level::info, "{}",
              printable(text, kLongestLine));
}

void end_log(int exit_code) {
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&out, 1, kFarewellPatience_ms) == 0) ::_exit(exit_code);
  spdlog::shutdown();
}

}  // namespace nodal::daemon
