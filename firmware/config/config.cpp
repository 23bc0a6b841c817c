#include "firmware/config/config.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <set>

#include "firmware/config/gpio_entry.h"
#include "firmware/config/head_entry.h"
#include "protocol/base/limits.h"
#include "protocol/toml/toml_reader.h"
#include "stitch/sets/raymap_toml.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kMaxUnixPath = 107;  // bytes; sockaddr_un::sun_path holds 108, the last of them 0

std::optional<FrameRate> parse_rate(std::string_view text) {
  const std::size_t slash = text.find('/');
  const auto above = parse_whole(text.substr(0, slash));
  const auto below =
      slash == std::string_view::npos ? std::optional<std::uint32_t>(1) : parse_whole(text.substr(slash + 1));
  if (!above || !below) return std::nullopt;
  return FrameRate::make(*above, *below);
}

void read_rig(TomlReader reader, RigConfig& config) {
  config.name = read_name(reader);
  if (!reader.has("rate")) return;
  if (const auto rate = parse_rate(reader.text("rate", "30000/1001"))) {
    config.rate = *rate;
  } else {
    reader.refuse("rate",
                  "must be frames a second such as \"30000/1001\" or \"25\": " + std::string(kFrameRatesAllowed));
  }
}

/// Call after the heads are read: the raymap's format can only be made from certain formats of heads.
void check_formats(TomlReader reader, const std::vector<HeadConfig>& heads, PixelFormat raymap) {
  const char* wanted = has_chroma(raymap) ? "I420, NV12, I422, YUYV, UYVY, YUV411, MJPEG or a Bayer format"
                       : in_8_bits(raymap) == PixelFormat::kRgb24 ? "RGB24, MJPEG or a Bayer format"
                                                                  : "GREY, MJPEG or a Bayer format";
  for (const HeadConfig& head : heads) {
    if (blended_format(head.format, raymap)) continue;
    const std::string format(pixel_format_name(raymap));
    return reader.refuse("format", "is \"" + format + "\", which needs heads with " + wanted +
                                       ", but the format of head '" + head.name + "' is " +
                                       std::string(pixel_format_name(head.format)) + "; change one of the two formats");
  }
}

/// Call after the heads are read: separate fields form sets only if all heads are interlaced and expose the same field
/// first.
void check_field_use(TomlReader reader, const std::vector<HeadConfig>& heads, const RaymapConfig& raymap) {
  if (raymap.fields == FieldUse::kWeave) return;
  for (const HeadConfig& head : heads) {
    if (head.fields == Fields::kProgressive) {
      return reader.refuse("fields",
                           "is \"separate\", but the frames of head '" + head.name +
                               "' are progressive; write top-first or bottom-first in its entry, or weave here");
    }
    if (head.fields != heads[0].fields) {
      return reader.refuse("fields", "is \"separate\", but heads '" + heads[0].name + "' and '" + head.name +
                                         "' do not expose the same field first");
    }
  }
}

void read_trigger(TomlReader reader, FrameRate rate, TriggerConfig& trigger) {
  trigger.start = reader.boolean("start", false);
  trigger.pulse_width = Duration::microseconds(reader.integer("pulse_width_us", 1, 100'000, 100));
  if (trigger.pulse_width >= rate.period()) {
    reader.refuse("pulse_width_us", fmt::format("must be shorter than a frame, {} us here", rate.period().us()));
  }
  trigger.active_high = reader.choice<bool>("polarity", {{"high", true}, {"low", false}});
  trigger.source = reader.choice<SyncSource>(
      "source", {{"own", SyncSource::kOwn}, {"external", SyncSource::kExternal}, {"none", SyncSource::kNone}});
  trigger.port = read_line(reader, "port", {false, true});
  trigger.readback = read_line(reader, "readback", {});
}

Stops stops_from(double stops) { return static_cast<Stops>(std::lround(stops * kStop)); }

/// Call after the heads are read: the anchor must be one of them.
void read_exposure(TomlReader reader, const std::vector<HeadConfig>& heads, ExposureSettings& settings) {
  settings.program = reader.choice<ExposureProgram>(
      "program",
      {{"manual", ExposureProgram::kManual}, {"each", ExposureProgram::kEach}, {"joint", ExposureProgram::kJoint}});
  settings.target = -stops_from(reader.number("target_stops", 0.5, 8, 2.5));
  settings.difference = stops_from(reader.number("difference_stops", 0, 8, 1));
  settings.ramp = stops_from(reader.number("ramp_stops", 0.001, 8, 4));
  settings.longest = Exposure::microseconds(reader.integer("longest_us", 1, 10'000'000, settings.longest.us()));
  settings.highest = Gain::millidecibels(
      static_cast<std::int32_t>(reader.integer("highest_gain_mdb", -kMaxGainMdb, kMaxGainMdb, settings.highest.mdb())));
  const std::string anchor = reader.text("anchor", "");
  if (anchor.empty()) return;
  const auto found =
      std::find_if(heads.begin(), heads.end(), [&](const HeadConfig& head) { return head.name == anchor; });
  if (found == heads.end()) return reader.refuse("anchor", "is \"" + anchor + "\", but no head has that name");
  settings.anchor = static_cast<HeadIndex>(found - heads.begin());
}

std::string read_socket(TomlReader& reader, const std::string& key, const std::string& otherwise, SocketFile& file) {
  const std::string path = reader.text(key, otherwise);
  if (path.size() > kMaxUnixPath) {
    reader.refuse(key, fmt::format("is {} bytes long; a Unix socket's path has at most {}", path.size(), kMaxUnixPath));
  }
  constexpr std::int64_t kAllBits = 0777;
  if (reader.has(key + "_mode")) {
    file.mode = static_cast<std::uint32_t>(reader.integer(key + "_mode", 0, kAllBits, 0));
  }
  file.group = reader.text(key + "_group", "");
  return path;
}

void read_links(TomlReader reader, LinksConfig& links) {
  links.unix_path = read_socket(reader, "unix", links.unix_path, links.unix_file);
  links.view_path = read_socket(reader, "view", links.view_path, links.view_file);
  links.operate_path = read_socket(reader, "operate", links.operate_path, links.operate_file);
  if (!links.view_path.empty() && links.view_path == links.unix_path) {
    reader.refuse("view", "is the path of the control socket; give it one of its own");
  }
  if (!links.operate_path.empty() && (links.operate_path == links.unix_path || links.operate_path == links.view_path)) {
    reader.refuse("operate", "is the path of another socket; give it one of its own");
  }
  links.usb_folder = reader.text("usb", "");
  if (reader.has("tcp_port")) {
    reader.refuse("tcp_port",
                  "is no longer supported, because any user of the machine could connect; remove it and "
                  "use the Unix socket or ssh://HOST");
  }
}

/// What follows "sim:" is parsed by daemon/panel_ports.
void read_panel(TomlReader reader, PanelConfig& panel) {
  const auto read = [&](const char* key, std::string& pin, std::optional<GpioLine>& line, const LineOptions& allowed) {
    pin = reader.text(key, "");
    if (!reader.has(key) || pin.starts_with("sim:")) return;
    line = read_line(reader, key, allowed);
  };
  read("button", panel.button, panel.button_line, {true, true, "sim:TIME+LENGTH,... or "});
  read("status", panel.status, panel.status_line, {true, false, "sim: or "});
  read("tally", panel.tally, panel.tally_line, {true, false, "sim: or "});
}

void read_constant(TomlReader& reader, SimConfig& sim) {
  const toml::array* levels = reader.array("constant");
  if (!levels) return;
  bool good = levels->size() == 3;
  for (std::size_t c = 0; good && c < 3; ++c) {
    const auto level = (*levels)[c].value_exact<std::int64_t>();
    good = level && *level >= 0 && *level <= 255;
    if (good) sim.constant[c] = static_cast<std::uint8_t>(*level);
  }
  if (!good) reader.refuse("constant", "must be [red, green, blue], each a whole number 0 to 255");
}

void read_sim(TomlReader reader, SimConfig& sim) {
  sim.calibration = reader.required_text("calibration");
  sim.scene = reader.choice<SimConfig::Scene>("scene", {{"procedural", SimConfig::Scene::kProcedural},
                                                        {"constant", SimConfig::Scene::kConstant},
                                                        {"photo", SimConfig::Scene::kPhoto},
                                                        {"bar", SimConfig::Scene::kBar}});
  sim.photo = reader.text("photo", "");
  if (sim.scene == SimConfig::Scene::kPhoto && sim.photo.empty()) {
    reader.refuse("photo", "must name an equirectangular JPEG or PNG when scene is \"photo\"", Errc::kMissingField);
  }
  if (sim.scene != SimConfig::Scene::kPhoto && reader.has("photo")) {
    reader.refuse("photo", "is only allowed when scene is \"photo\"");
  }
  if (sim.scene != SimConfig::Scene::kConstant && reader.has("constant")) {
    reader.refuse("constant", "is only allowed when scene is \"constant\"");
  }
  read_constant(reader, sim);
  sim.noise = reader.number("noise", 0, 64, 0);
  sim.seed = static_cast<std::uint64_t>(reader.integer("seed", 0, std::numeric_limits<std::int64_t>::max(), 1));
  sim.clock =
      reader.choice<SimConfig::Clock>("clock", {{"real", SimConfig::Clock::kReal}, {"fast", SimConfig::Clock::kFast}});
}

TakeMode read_take_mode(TomlReader& reader, std::string_view key, TakeMode fallback) {
  if (!reader.has(key)) return fallback;
  return reader.choice<TakeMode>(key, {{"driver", TakeMode::kDriver},
                                       {"raw", TakeMode::kRaw},
                                       {"jpeg", TakeMode::kJpeg},
                                       {"lossless", TakeMode::kLossless}});
}

/// `mode`: of heads without take_mode.
void read_heads(TomlReader& file, RigConfig& config, TakeMode mode, FirstError& error) {
  const toml::array* heads = file.array("heads");
  if (!heads || heads->empty()) {
    file.refuse("heads", "is missing; write one [[heads]] for every head of the rig", Errc::kMissingField);
    return;
  }
  if (heads->size() > static_cast<std::size_t>(kMaxHeads)) {
    file.refuse("heads", fmt::format("has {} entries; a rig has at most {}", heads->size(), kMaxHeads));
    return;
  }
  std::set<std::string> names;
  std::set<std::pair<PortKind, std::string>> ports;
  for (std::size_t i = 0; i < heads->size(); ++i) {
    const toml::table* table = (*heads)[i].as_table();
    if (!table) {
      file.refuse("heads", "must be tables, written [[heads]]");
      return;
    }
    TomlReader reader(*table, fmt::format("heads[{}]", i),
                      {"name",     "port",  "format",       "exposure_us",   "gain_mdb",         "red_q12",
                       "blue_q12", "gamma", "fields",       "trigger_mode",  "trigger_delay_us", "trigger",
                       "size",     "input", "standard",     "gain_step_mdb", "readout_us",       "separate_fields",
                       "left",     "top",   "packet_bytes", "exposure_by",   "take_mode"},
                      error);
    HeadConfig head = read_head(reader, config.rate);
    head.take_mode = read_take_mode(reader, "take_mode", mode);
    if (reader.has("take_mode") && !config.takes) {
      reader.refuse("take_mode", "is for rigs that record; write [takes] folder, too");
    }
    if (!names.insert(head.name).second)
      reader.refuse("name", "\"" + head.name + "\" is the name of a head above, too");
    if (!ports.insert({head.port.kind, head.port.name}).second)
      reader.refuse("port", "is the port of a head above, too");
    config.heads.push_back(std::move(head));
  }
}

RigConfig read_file(const toml::table& root, FirstError& error, const ReadRayFile& read_rays) {
  RigConfig config;
  TomlReader file(
      root, "",
      {"rig", "raymap", "trigger", "exposure", "links", "panel", "store", "takes", "calibration", "sim", "heads"},
      error);
  static const toml::table kEmpty;
  const auto section = [&](std::string_view name) -> const toml::table& {
    const toml::table* table = file.table(name);
    return table ? *table : kEmpty;
  };
  if (!file.has("rig")) file.refuse("rig", "is missing; write a table [rig] with the rig's name", Errc::kMissingField);
  read_rig({section("rig"), "rig", {"name", "rate"}, error}, config);
  TomlReader raymap = sets::raymap_reader(section("raymap"), error);
  config.raymap = sets::read_raymap(raymap, read_rays);
  read_trigger(
      {section("trigger"), "trigger", {"start", "pulse_width_us", "polarity", "source", "port", "readback"}, error},
      config.rate, config.trigger);
  read_links({section("links"),
              "links",
              {"unix", "unix_mode", "unix_group", "view", "view_mode", "view_group", "operate", "operate_mode",
               "operate_group", "usb", "tcp_port"},
              error},
             config.links);
  read_panel({section("panel"), "panel", {"button", "status", "tally"}, error}, config.panel);
  TomlReader store(section("store"), "store", {"folder"}, error);
  config.store = store.text("folder", config.store);
  if (config.store.empty()) store.refuse("folder", "must not be empty");
  TakeMode mode = TakeMode::kDriver;
  if (file.has("takes")) {
    TomlReader takes(
        section("takes"), "takes",
        {"folder", "mounted", "buffer_mb", "raymap", "start", "when_full", "mode", "quality", "flight_recorder"},
        error);
    TakesConfig& to = config.takes.emplace();
    to.folder = takes.required_text("folder");
    to.mounted = takes.boolean("mounted", to.mounted);
    to.buffer_mb = static_cast<int>(takes.integer("buffer_mb", 16, 4096, to.buffer_mb));
    to.raymap = takes.boolean("raymap", to.raymap);
    to.at_start = takes.choice<bool>("start", {{"request", false}, {"boot", true}});
    to.loop = takes.choice<bool>("when_full", {{"stop", false}, {"loop", true}});
    mode = read_take_mode(takes, "mode", mode);
    to.quality = static_cast<int>(takes.integer("quality", 1, 100, to.quality));
    to.flight_recorder = takes.boolean("flight_recorder", to.flight_recorder);
  }
  TomlReader calibration(section("calibration"), "calibration", {"signers"}, error);
  config.signers_file = calibration.text("signers", "");
  if (calibration.has("signers") && config.signers_file.empty()) calibration.refuse("signers", "must not be empty");
  read_heads(file, config, mode, error);
  const bool jpegs = std::ranges::count(config.heads, TakeMode::kJpeg, &HeadConfig::take_mode) > 0;
  if (file.has("takes") && section("takes").contains("quality") && !jpegs) {
    file.refuse("takes", "has a quality, which is for mode = \"jpeg\" only");
  }
  check_formats(raymap, config.heads, config.raymap.format);
  for (const HeadConfig& head : config.heads) {
    if (config.trigger.source != SyncSource::kNone) continue;
    const std::string no_pulse = "has source = \"none\", so head '" + head.name + "' has no trigger pulse to ";
    if (head.wired) file.refuse("trigger", no_pulse + "follow; remove its trigger_mode");
    if (head.trigger_delay != Duration()) file.refuse("trigger", no_pulse + "delay; remove its trigger_delay_us");
  }
  check_field_use(raymap, config.heads, config.raymap);
  read_exposure(
      {section("exposure"),
       "exposure",
       {"program", "anchor", "target_stops", "difference_stops", "ramp_stops", "longest_us", "highest_gain_mdb"},
       error},
      config.heads, config.exposure);

  const bool wants_sim = std::any_of(config.heads.begin(), config.heads.end(),
                                     [](const HeadConfig& head) { return head.port.kind == PortKind::kSim; });
  if (file.has("sim")) {
    read_sim({section("sim"), "sim", {"calibration", "scene", "photo", "constant", "noise", "seed", "clock"}, error},
             config.sim.emplace());
    if (!wants_sim) file.refuse("sim", "is only allowed when a head is on a sim: port");
    const bool has_devices = std::any_of(config.heads.begin(), config.heads.end(), [](const HeadConfig& head) {
      return head.port.kind == PortKind::kV4l2 || head.port.kind == PortKind::kIidc;
    });
    if (has_devices && config.sim->clock == SimConfig::Clock::kFast) {
      file.refuse("sim", "has clock = \"fast\", but heads on v4l2: and iidc: ports send frames in real time");
    }
  } else if (wants_sim) {
    file.refuse("sim", "is missing; heads on sim: ports need it", Errc::kMissingField);
  }
  check_lines(file, config);
  return config;
}

}  // namespace

Result<RigConfig> parse_rig_config(std::string_view text, std::string_view file, const ReadRayFile& read_rays) {
  if (text.size() > kMaxRigTomlBytes) {
    return fail(Errc::kTooLarge,
                fmt::format("{}: is {} bytes; a rig.toml has at most {}", file, text.size(), kMaxRigTomlBytes));
  }
  FirstError error(file);
  const toml::parse_result parsed = toml::parse(text);
  if (!parsed) {
    error.set(Errc::kBadFormat, parsed.error().source(), "not TOML: " + std::string(parsed.error().description()));
    return fail(error.get());
  }
  RigConfig config = read_file(parsed.table(), error, read_rays);
  if (error.any()) return fail(error.get());
  config.text_id = sha256(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
  config.text = std::make_shared<const std::string>(text);
  return config;
}

}  // namespace nodal::firmware
