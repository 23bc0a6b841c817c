// nodald: reads rig.toml, makes the ports, starts the threads, waits for a signal.
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cinttypes>
#include <csignal>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <new>
#include <system_error>
#include <thread>

#include "firmware/daemon/board_ports.h"
#include "firmware/daemon/bridge.h"
#include "firmware/daemon/confined_work.h"
#include "firmware/daemon/device_scanner.h"
#include "firmware/daemon/drivers.h"
#include "firmware/daemon/end_deadline.h"
#include "firmware/daemon/line_ports.h"
#include "firmware/daemon/log.h"
#include "firmware/daemon/memory.h"
#include "firmware/daemon/options.h"
#include "firmware/daemon/scan_report.h"
#include "firmware/daemon/takes_disk.h"
#include "firmware/daemon/threads.h"
#include "firmware/daemon/version.h"
#include "hal/linux/gpio/system.h"
#include "hal/linux/link/signals.h"
#include "hal/linux/link/standard_descriptors.h"
#include "hal/linux/thread/thread.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"

namespace nodal::daemon {
namespace {

using std::chrono::milliseconds;

/// Limits of the time from the signal to the end of the process, which must be below 2 s, and of the farewell to hosts.
constexpr milliseconds kEndWithin{1800};
constexpr milliseconds kFarewellWithin{900};
/// Limits of one jump of virtual time, which goes from event to event.
constexpr Duration kShortestJump = Duration::microseconds(100);
constexpr Duration kLongestJump = Duration::milliseconds(20);

int give_up(const Error& error, int exit_code) {
  log_line(LogLevel::kError, error.text());
  return exit_code;
}

/// Resident memory in bytes, from the second number of /proc/self/statm; 0 when it cannot be read.
std::uint64_t resident_bytes() {
  const Result<FilePtr> file = open_to_read("/proc/self/statm");
  if (!file) return 0;
  std::uint64_t all = 0;
  std::uint64_t resident = 0;
  const int read = std::fscanf(file->get(), "%" SCNu64 " %" SCNu64, &all, &resident);
  return read == 2 ? resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) : 0;
}

std::string describe(const firmware::RigConfig& config) {
  return fmt::format("rig '{}': {} heads at {}/{} frames a second, raymap {} {}x{} {}", config.name,
                     config.heads.size(), config.rate.numerator, config.rate.denominator, config.raymap.layout,
                     config.raymap.width, config.raymap.height, pixel_format_name(config.raymap.format));
}

/// While nodald starts it drives no output and has no socket, so a signal may end it at once, also during a blocking
/// call.
void end_while_starting(const sigset_t& signals) {
  struct sigaction at_once {};
  at_once.sa_handler = [](int) { ::_exit(kExitFine); };
  for (int signal = 1; signal < SIGRTMIN; ++signal) {
    if (sigismember(&signals, signal) == 1) ::sigaction(signal, &at_once, nullptr);
  }
  ::pthread_sigmask(SIG_UNBLOCK, &signals, nullptr);
}

/// noexcept, like close() below: while the rig runs, an exception must call EndDeadline's terminate handler.
void wait_for_signal(firmware::Rig& rig, const sigset_t& signals, EndDeadline& deadline) noexcept {
  const timespec second{1, 0};
  for (;;) {
    rig.control().set_resident_bytes(resident_bytes());
    const int signal = ::sigtimedwait(&signals, nullptr, &second);
    if (signal < 0) continue;
    deadline.arm(kEndWithin);
    deadline.waits_for("nodal-control");
    const std::string name = hal::signal_name(signal);
    log_line(LogLevel::kInfo, name + ": stopping");
    rig.control().ask_to_end(name);
    const auto until = std::chrono::steady_clock::now() + kFarewellWithin;
    while (!rig.control().ended() && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(milliseconds(5));
    }
    return;
  }
}

void close(firmware::Rig& rig) noexcept {
  rig.close();
  const firmware::CaptureReport& capture = rig.capture().report();
  log_line(LogLevel::kInfo, fmt::format("stopped: {} frames from the heads: {} in sets, {} lost; {} sets, {} raymaps",
                                        capture.frames.frames, capture.frames.in_sets, capture.frames.lost(),
                                        capture.sets, rig.blender().counts().blended.load()));
}

struct ConfinedPorts {
  std::unique_ptr<hal::ConfinedPort> recovery, rehearsal;
};

/// Runs the rig until a signal arrives.
void run_rig(BoardPorts& ports, TakesDisk& takes, const ConfinedPorts& confined, const Options& options,
             const firmware::RigConfig& config, const sigset_t& signals, EndDeadline& deadline) {
  firmware::RigPorts rig_ports = ports.ports();
  rig_ports.takes = takes.to_write.get();
  rig_ports.takes_read = takes.to_read.get();
  rig_ports.recovery = confined.recovery.get();
  rig_ports.rehearsal = confined.rehearsal.get();
  rig_ports.utc = utc_ns;
  hal::Heartbeats heartbeats;
  rig_ports.heartbeats = &heartbeats;
  firmware::Rig rig(config, rig_ports, kSoftware);
  for (const std::string& address : ports.addresses()) log_line(LogLevel::kInfo, "hosts can connect at " + address);

  RigThreads::Hooks hooks;
  hooks.log = [](const std::string& sentence) { log_line(LogLevel::kInfo, sentence); };
  hooks.waits_for = [&deadline](const char* thread) { deadline.waits_for(thread); };
  if (ports.has_virtual_time()) {
    hooks.advance = [&ports, &rig](Instant next) {
      const Duration step = std::clamp(next - ports.ports().clock.now(), kShortestJump, kLongestJump);
      // Before a calibration is in force, virtual time runs no faster than real time.
      if (rig.blender().counts().adopted.load() == 0) std::this_thread::sleep_for(std::chrono::nanoseconds(step.ns()));
      ports.advance(step);
    };
  }
  const unsigned cores = std::max(1U, std::thread::hardware_concurrency());
  const int blend_threads = options.blend_threads > 0 ? options.blend_threads : static_cast<int>(cores);
  {
    const RigThreads threads(rig, ports.ports().clock, blend_threads, hooks);
    wait_for_signal(rig, signals, deadline);
  }
  deadline.waits_for("closing the heads and the trigger");
  close(rig);
}

int scan(const Options& options) {
  const auto devices = MachineDevices().scan(kScanWithin);
  const Result<std::string> found =
      options.json ? scan_json(devices, places_of_this_user()) : scan_text(devices, places_of_this_user());
  if (!found) return give_up(found.error(), kExitFailed);
  const std::string text = options.json ? *found + "\n" : *found;
  const bool written = std::fputs(text.c_str(), stdout) >= 0 && std::fflush(stdout) == 0;
  return written ? kExitFine : give_up({Errc::kIo, "standard output cannot be written"}, kExitFailed);
}

int make_lines_safe(const firmware::RigConfig& config) {
  const SafeLevels done = set_safe_levels(config, gpio_chips());
  for (const std::string& line : done.lines) log_line(LogLevel::kInfo, line);
  for (const Error& problem : done.problems) log_line(LogLevel::kError, problem.text());
  return done.problems.empty() ? kExitFine : kExitCannotStart;
}

Status start_confined(const firmware::RigConfig& config, const std::filesystem::path& base, ConfinedPorts& into) {
  NODAL_TRY_ASSIGN(auto rehearsal, start_rehearsal(config));
  into.rehearsal = std::move(rehearsal);
  if (config.takes) {
    NODAL_TRY_ASSIGN(auto recovery, start_recovery(base / config.takes->folder));
    into.recovery = std::move(recovery);
  }
  if (const std::string missing = missing_confinement(); !missing.empty()) log_line(LogLevel::kInfo, missing);
  return {};
}

int run(const Options& options, const firmware::RigConfig& config, const std::filesystem::path& base,
        const sigset_t& signals, EndDeadline& deadline) {
  ConfinedPorts confined;
  if (!options.check) {
    // Before devices and sockets are open, so that the processes have none of them.
    if (const Status started = start_confined(config, base, confined); !started)
      return give_up(started.error(), kExitCannotStart);
  }
  auto ports = BoardPorts::make(config, base);
  if (!ports) return give_up(ports.error(), kExitBadInput);
  if (options.check) {
    if (const Status checked = (*ports)->check_devices(config); !checked)
      return give_up(checked.error(), kExitBadInput);
    const std::vector<Error> problems = (*ports)->claim_lines(config);
    for (const Error& problem : problems) log_line(LogLevel::kError, problem.text());
    if (!problems.empty()) return kExitBadInput;
    show(fmt::format("{} is fine: {}\n", options.config, describe(config)));
    return kExitFine;
  }
  log_line(LogLevel::kInfo, std::string(kSoftware) + ": " + describe(config));
  // Before the long preparation, so that a second nodald ends at once. The sockets open when the rig can serve them.
  if (const Status free = (*ports)->check_links(config.links); !free) return give_up(free.error(), kExitCannotStart);
  (*ports)->prepare();
  std::filesystem::path store = options.store;
  if (store.empty()) store = base / config.store;
  if (const Status opened = (*ports)->open_store(store); !opened) {
    Error error = opened.error();
    if (error.code == Errc::kIo) error.message += "; name another folder by --store, or by [store] folder in rig.toml";
    return give_up(error, kExitCannotStart);
  }
  TakesDisk takes;
  if (config.takes) {
    auto opened = open_takes_disk(base / config.takes->folder, config.takes->mounted);
    if (!opened) return give_up(opened.error(), kExitCannotStart);
    takes = std::move(*opened);
  }
  // From here on there are sockets to remove, and soon outputs are driven: wait_for_signal() takes the signals.
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  if (const Status listening = (*ports)->listen(config); !listening) {
    return give_up(listening.error(), kExitCannotStart);
  }
  for (const Error& problem : (*ports)->claim_lines(config)) {
    log_line(LogLevel::kError, problem.text() + "; the rig runs without it until nodald is restarted");
  }
  for (const std::string& notice : (*ports)->notices()) log_line(LogLevel::kError, notice);
  const EndDeadline::Protection protection = deadline.protect([&ports = **ports] { ports.make_safe(); });
  run_rig(**ports, takes, confined, options, config, signals, deadline);
  return kExitFine;
}

int start(int argc, char** argv, EndDeadline& deadline) {
  keep_large_blocks_apart();
  const Parsed parsed = parse_options(argc, argv);
  if (parsed.exit) return *parsed.exit;
  const Options& options = parsed.options;
  // Blocks the signals before the log's thread starts, so that it never receives one.
  const sigset_t signals = hal::ending_signals();
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  hal::ignore_stray_signals();
  start_log(options.log);
  end_while_starting(signals);

  if (options.scan) return scan(options);
  firmware::RigConfig config;
  std::filesystem::path base;
  if (!options.config.empty()) {
    base = std::filesystem::absolute(options.config).parent_path();
    auto read = read_rig_config(options.config);
    if (!read) return give_up(read.error(), kExitBadInput);
    config = std::move(*read);
    firmware::LinksConfig& links = config.links;
    for (std::string* path : {&links.unix_path, &links.view_path, &links.operate_path, &links.usb_folder}) {
      if (!path->empty()) *path = (base / *path).string();  // relative to rig.toml's folder
    }
  }
  if (options.bridge) {
    return run_bridge(options.socket.empty() ? config.links.unix_path : options.socket);
  }
  if (options.safe_levels) return make_lines_safe(config);
  return run(options, config, base, signals, deadline);
}

/// The standard library throws these when the system refuses memory or a thread.
int main(int argc, char** argv, EndDeadline& deadline) {
  try {
    return start(argc, argv, deadline);
  } catch (const std::bad_alloc&) {
    return give_up({Errc::kOverload, "cannot start: " + explain_refused_memory()}, kExitCannotStart);
  } catch (const std::system_error&) {
    return give_up({Errc::kOverload, "cannot start: " + explain_refused_memory()}, kExitCannotStart);
  }
}

}  // namespace
}  // namespace nodal::daemon

int main(int argc, char** argv) {
  nodal::hal::guard_standard_descriptors();
  nodal::daemon::EndDeadline deadline;
  const int exit_code = nodal::daemon::main(argc, argv, deadline);
  deadline.finished(exit_code);
  nodal::daemon::end_log(exit_code);
  return exit_code;
}
