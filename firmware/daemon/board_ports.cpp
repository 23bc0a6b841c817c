#include "firmware/daemon/board_ports.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>

#include "firmware/daemon/device_heads.h"
#include "firmware/daemon/device_scanner.h"
#include "firmware/daemon/drivers.h"
#include "firmware/daemon/line_ports.h"
#include "firmware/daemon/log.h"
#include "firmware/daemon/panel_ports.h"
#include "firmware/daemon/replay_deck.h"
#include "firmware/daemon/traced_heads.h"
#include "hal/linux/cable/cable.h"
#include "hal/linux/clock.h"
#include "hal/linux/disk.h"
#include "hal/linux/link/socket_link.h"
#include "hal/linux/thread/thread.h"
#include "hal/linux/watchdog.h"
#include "hal/sim/rig.h"
#include "hal/sim/scene/response.h"
#include "hal/sim/scene/scene.h"
#include "protocol/base/try.h"
#include "protocol/files/open_file.h"
#include "stitch/media/plain_image.h"

namespace nodal::daemon {
namespace {

using firmware::HeadConfig;
using firmware::PortKind;
using firmware::RigConfig;
using firmware::SimConfig;

constexpr int kHeadBuffers = static_cast<int>(firmware::kFramesAHead);

Result<std::string> read_text(const std::filesystem::path& file, std::size_t limit) {
  const Result<FilePtr> in = open_to_read(file);
  if (!in) return fail(in.error().in(file.string()));
  std::string text(limit + 1, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), in->get()));
  if (std::ferror(in->get()) != 0) return fail(Errc::kIo, file.string() + ": " + std::strerror(errno));
  if (text.size() > limit) {
    return fail(Errc::kTooLarge, fmt::format("{}: is over {} bytes", file.string(), limit));
  }
  return text;
}

/// Opens heads in the simulation, in the replay or on devices, by the word before the colon.
class Enumerators final : public hal::HeadEnumerator {
 public:
  hal::HeadEnumerator* sim = nullptr;
  hal::HeadEnumerator* replay = nullptr;
  hal::HeadEnumerator* devices = nullptr;

  Result<std::unique_ptr<hal::HeadPort>> open(const std::string& path) override {
    hal::HeadEnumerator* const asked = path.starts_with("sim:") ? sim : DeviceHeads::opens(path) ? devices : replay;
    if (!asked) return fail(Errc::kNoSuchDevice, "nothing opens heads at " + path);
    return asked->open(path);
  }
  std::vector<hal::HeadIdentity> list() override {
    std::vector<hal::HeadIdentity> all;
    for (hal::HeadEnumerator* one : {sim, replay, devices}) {
      if (!one) continue;
      auto some = one->list();
      all.insert(all.end(), some.begin(), some.end());
    }
    return all;
  }
};

/// The trigger of a rig with simulated and replayed heads, or with them and a line: starts both, and reports the edges
/// of the first.
class BothTriggers final : public hal::TriggerPort {
 public:
  BothTriggers(hal::TriggerPort& first, hal::TriggerPort& second) : first_(first), second_(second) {}
  Status start(const hal::TriggerSettings& settings) override {
    NODAL_TRY(first_.start(settings));
    return second_.start(settings);
  }
  void stop() override {
    first_.stop();
    second_.stop();
  }
  Result<std::optional<hal::TriggerEdge>> take_edge() override {
    (void)second_.take_edge();  // discarded, because its queue is bounded
    return first_.take_edge();
  }
  void add_wake_ups(hal::WakeUps& to) const override { first_.add_wake_ups(to); }
  hal::TriggerCounts counts() const override { return first_.counts(); }

  void make_safe() noexcept override {
    first_.make_safe();
    second_.make_safe();
  }

 private:
  hal::TriggerPort& first_;
  hal::TriggerPort& second_;
};

Result<hal::sim::ScenePtr> make_scene(const SimConfig& sim, const Calibration& truth,
                                      const std::filesystem::path& base) {
  switch (sim.scene) {
    case SimConfig::Scene::kProcedural: return hal::sim::town_square_scene(sim.seed);
    case SimConfig::Scene::kConstant: {
      const Response& response = truth.heads.front().response;
      const auto light = [&](std::size_t c) {
        return static_cast<float>(hal::sim::decode(response, sim.constant[c] / 255.0));
      };
      return hal::sim::constant_scene({light(0), light(1), light(2)});
    }
    case SimConfig::Scene::kBar: return hal::sim::bar_scene({0, 1, 0}, Duration::seconds(4), 0.1);
    case SimConfig::Scene::kPhoto: break;
  }
  const auto photo = media::read_plain_image(base / sim.photo, PixelFormat::kRgb24);
  if (!photo) return fail(photo.error().in("sim.photo"));
  Response encoding;
  encoding.curve = Response::Curve::kSrgb;
  auto scene = hal::sim::photo_scene(photo->view(), encoding);
  if (!scene) return fail(scene.error().in("sim.photo " + sim.photo));
  return scene;
}

Result<std::unique_ptr<hal::sim::SimRig>> make_sim(const RigConfig& config, const std::filesystem::path& base) {
  const SimConfig& sim = *config.sim;
  const auto text = read_text(base / sim.calibration, kMaxCalibrationBytes);
  if (!text) return fail(text.error().in("sim.calibration"));
  const auto truth = parse_calibration(*text);
  if (!truth) return fail(truth.error().in("sim.calibration " + sim.calibration));

  std::vector<const HeadConfig*> wanted(truth->heads.size(), nullptr);
  for (const HeadConfig& head : config.heads) {
    if (head.port.kind != PortKind::kSim) continue;
    const auto found = std::find_if(truth->heads.begin(), truth->heads.end(),
                                    [&](const HeadCalibration& true_head) { return true_head.name == head.port.name; });
    if (found == truth->heads.end()) {
      return fail(Errc::kNoSuchDevice, fmt::format("head '{}' (line {} of rig.toml): {} has no head '{}'", head.name,
                                                   head.line, sim.calibration, head.port.name));
    }
    if (head.fields != Fields::kProgressive && found->height % 4 != 0) {
      return fail(
          Errc::kBadValue,
          fmt::format("head '{}' (line {} of rig.toml): a simulated head with fields has a multiple of 4 rows, not {}",
                      head.name, head.line, found->height));
    }
    wanted[static_cast<std::size_t>(found - truth->heads.begin())] = &head;
  }
  NODAL_TRY_ASSIGN(auto scene, make_scene(sim, *truth, base));

  hal::sim::SimRigOptions options;
  options.real_time = sim.clock == SimConfig::Clock::kReal;
  options.seed = sim.seed;
  options.scene = std::move(scene);
  options.head.rate = config.rate;
  options.head.noise.levels = sim.noise;
  options.head.buffers = kHeadBuffers;
  options.adjust = [&](HeadIndex index, hal::sim::HeadOptions& head) {
    if (!wanted[index]) return;
    head.pixels = wanted[index]->format;
    head.fields = wanted[index]->fields;
    if (wanted[index]->wired) head.trigger_latency = wanted[index]->trigger_delay;
  };
  return std::make_unique<hal::sim::SimRig>(*truth, options);
}

}  // namespace

struct BoardPorts::State {
  hal::linux_os::LinuxClock machine_clock;
  std::unique_ptr<hal::sim::SimRig> sim;
  std::unique_ptr<hal::replay::Deck> deck;
  std::unique_ptr<DeviceHeads> devices;
  Enumerators enumerators;
  std::unique_ptr<TracedHeads> traced;  ///< null: the log wants none of capture
  std::unique_ptr<LinePorts> lines;
  std::unique_ptr<BothTriggers> both, with_lines;
  hal::TriggerPort* trigger = nullptr;
  std::unique_ptr<hal::linux_os::LinuxDisk> disk;
  struct OpenListener {
    std::unique_ptr<hal::LinkListenerPort> port;
    firmware::Access access;
    std::string address;
  };
  std::vector<OpenListener> listeners;
  hal::linux_os::LinuxWatchdog watchdog;
  std::unique_ptr<PanelPorts> panel;
  DeviceScanner scanner;

  hal::ClockPort& clock() {
    if (sim) return sim->clock();
    return machine_clock;
  }
};

BoardPorts::BoardPorts(std::unique_ptr<State> state) : state_(std::move(state)) {}
BoardPorts::~BoardPorts() = default;

Result<firmware::RigConfig> read_rig_config(const std::filesystem::path& file) {
  const auto text = read_text(file, firmware::kMaxRigTomlBytes);
  if (!text && text.error().code == Errc::kNotFound) {
    return fail(Errc::kNotFound, text.error().message +
                                     "; nodald --scan prints one for the cameras that are plugged in, and nodald "
                                     "--explain explains every key");
  }
  if (!text) return fail(text.error());
  const std::filesystem::path folder = std::filesystem::absolute(file).parent_path();
  const auto read_rays = [&](const std::string& name) { return read_text(folder / name, kMaxRayFileBytes); };
  auto config = firmware::parse_rig_config(*text, file.string(), read_rays);
  if (!config || config->signers_file.empty()) return config;
  const std::filesystem::path signers = folder / config->signers_file;
  const auto lines = read_text(signers, kMaxAllowedSignersBytes);
  if (!lines) return fail(lines.error().in("calibration.signers"));
  auto parsed = AllowedSigners::parse(*lines);
  if (!parsed) return fail(parsed.error().in(signers.string()));
  config->signers = std::move(*parsed);
  return config;
}

Result<std::unique_ptr<BoardPorts>> BoardPorts::make(const RigConfig& config, const std::filesystem::path& base) {
  auto state = std::make_unique<State>();
  if (config.sim) {
    NODAL_TRY_ASSIGN(auto sim, make_sim(config, base));
    state->sim = std::move(sim);
    state->enumerators.sim = &state->sim->enumerator();
    state->trigger = &state->sim->trigger();
  }
  const bool replays = std::any_of(config.heads.begin(), config.heads.end(),
                                   [](const HeadConfig& head) { return is_replayed(head.port.kind); });
  if (replays) {
    state->deck = make_deck(config, base, state->clock(), kHeadBuffers);
    state->enumerators.replay = &state->deck->enumerator();
    if (state->trigger) {
      state->both = std::make_unique<BothTriggers>(*state->trigger, state->deck->trigger());
      state->trigger = state->both.get();
    } else {
      state->trigger = &state->deck->trigger();
    }
  }
  state->devices = std::make_unique<DeviceHeads>(config, state->machine_clock);
  state->enumerators.devices = state->devices.get();
  if (logs(LogCategory::kCapture, LogLevel::kDebug)) {
    state->traced = std::make_unique<TracedHeads>(state->enumerators, state->clock());
  }
  NODAL_TRY_ASSIGN(auto panel, PanelPorts::make(config.panel, state->clock()));
  state->panel = std::move(panel);
  return std::unique_ptr<BoardPorts>(new BoardPorts(std::move(state)));
}

Status BoardPorts::check_devices(const RigConfig& config) {
  // All stay open until the last one is, because heads of one USB bus share its bandwidth.
  std::vector<std::unique_ptr<hal::HeadPort>> heads;
  for (const HeadConfig& head : config.heads) {
    if (head.port.kind == PortKind::kSim) continue;
    const std::string port = head.port.text();
    auto opened =
        DeviceHeads::opens(port) ? state_->devices->open_and_wait(port) : state_->enumerators.replay->open(port);
    if (!opened) {
      return fail(opened.error().in(fmt::format("head '{}' (line {} of rig.toml)", head.name, head.line)));
    }
    heads.push_back(std::move(*opened));
  }
  return {};
}

std::vector<Error> BoardPorts::claim_lines(const RigConfig& config) {
  State& state = *state_;
  state.lines = std::make_unique<LinePorts>(config, gpio_chips());
  if (hal::TriggerPort* const trigger = state.lines->trigger()) {
    // Simulated and replayed heads are exposed by pulses of their own, which begin together with the line's.
    if (state.trigger != nullptr) state.with_lines = std::make_unique<BothTriggers>(*trigger, *state.trigger);
    state.trigger = state.trigger != nullptr ? state.with_lines.get() : trigger;
  }
  return state.lines->problems();
}

std::vector<std::string> BoardPorts::notices() const {
  if (!state_->lines || state_->lines->notice().empty()) return {};
  return {state_->lines->notice()};
}

void BoardPorts::prepare() {
  if (!state_->sim) return;
  std::atomic<int> next{0};
  std::mutex mutex;
  std::exception_ptr failed;
  const auto prepare = [&] {
    try {
      for (int head = next++; head < state_->sim->head_count(); head = next++) state_->sim->prepare(head);
    } catch (...) {
      const std::lock_guard lock(mutex);
      failed = std::current_exception();
    }
  };
  std::vector<hal::Thread> others;
  try {
    for (unsigned i = 1; i < std::thread::hardware_concurrency(); ++i)
      others.emplace_back("nodal-prepare", "", prepare);
  } catch (const std::system_error&) {
    // The threads that there are prepare all heads.
  }
  prepare();
  others.clear();  // joins
  if (failed) std::rethrow_exception(failed);
}

Status BoardPorts::open_store(const std::filesystem::path& folder) {
  auto disk = hal::linux_os::LinuxDisk::open(folder.string());
  if (!disk) return fail(disk.error().in("calibration store"));
  if (const Status mine = (*disk)->claim(); !mine) return fail(mine.error().in("calibration store"));
  state_->disk = std::move(*disk);
  return {};
}

Status BoardPorts::listen(const firmware::RigConfig& config) {
  const firmware::LinksConfig& links = config.links;
  const auto open = [&](const std::string& path, const firmware::SocketFile& file, firmware::Access access) -> Status {
    if (path.empty()) return {};
    NODAL_TRY_ASSIGN(auto listener, hal::listen_link("unix:" + path, {file.mode, file.group}));
    std::string address = hal::listener_address(*listener);
    state_->listeners.push_back({std::move(listener), access, std::move(address)});
    return {};
  };
  NODAL_TRY(open(links.unix_path, links.unix_file, firmware::Access::kControl));
  NODAL_TRY(open(links.view_path, links.view_file, firmware::Access::kView));
  NODAL_TRY(open(links.operate_path, links.operate_file, firmware::Access::kOperate));
  if (links.usb_folder.empty()) return {};
  NODAL_TRY_ASSIGN(auto cable, hal::cable::listen_cable(links.usb_folder, config.name));
  state_->listeners.push_back({std::move(cable), firmware::Access::kControl, "usb:" + links.usb_folder});
  return {};
}

Status BoardPorts::check_links(const firmware::LinksConfig& links) const {
  for (const std::string& path : {links.unix_path, links.view_path, links.operate_path}) {
    if (path.empty() || !hal::connect_link("unix:" + path)) continue;
    return fail(Errc::kExists, "unix:" + path + ": a program listens there already; stop it or choose another path");
  }
  return {};
}

firmware::RigPorts BoardPorts::ports() {
  NODAL_ASSERT(state_->disk);
  hal::HeadEnumerator& heads =
      state_->traced ? static_cast<hal::HeadEnumerator&>(*state_->traced) : state_->enumerators;
  firmware::RigPorts ports{state_->clock(),
                           heads,
                           state_->trigger,
                           *state_->disk,
                           {},
                           &state_->watchdog,
                           state_->panel->pins(),
                           &state_->machine_clock,
                           &state_->scanner};
  if (state_->lines) state_->lines->add_to(ports.panel);
  for (const auto& each : state_->listeners) ports.listeners.push_back({each.port.get(), each.access});
  return ports;
}

void BoardPorts::make_safe() noexcept {
  if (state_->trigger != nullptr) state_->trigger->make_safe();
  state_->panel->make_safe();
  if (state_->lines) state_->lines->make_safe();
}

bool BoardPorts::has_virtual_time() const { return state_->sim && state_->sim->clock().is_virtual(); }

bool BoardPorts::advance(Duration by) {
  if (!has_virtual_time()) return false;
  state_->sim->clock().advance(by);
  return true;
}

std::vector<std::string> BoardPorts::addresses() const {
  std::vector<std::string> all;
  for (const auto& [port, access, address] : state_->listeners) {
    all.push_back(address);
    if (access != firmware::Access::kControl) all.back() += fmt::format(" ({})", firmware::socket_name(access));
  }
  return all;
}

}  // namespace nodal::daemon
