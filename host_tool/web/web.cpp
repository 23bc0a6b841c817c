#include "host_tool/web/web.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>

#include "host_tool/look/film.h"
#include "host_tool/look/numbers.h"
#include "host_tool/look/page_files.h"
#include "host_tool/offload/take_json.h"
#include "host_tool/rig/wire_json.h"
#include "host_tool/web/header_values.h"
#include "host_tool/web/metrics.h"
#include "host_tool/web/operations.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/text.h"
#include "protocol/strict_json.h"
#include "protocol/take/file_names.h"

namespace nodal::host::web {
namespace {

using look::Answer;
using look::Wanted;

constexpr std::chrono::milliseconds kFirstPicture{5000};
constexpr std::size_t kMaxThumbnail = 1 << 20;
constexpr std::string_view kApi = "api/", kTakes = "takes/", kThumbs = "thumbs/";

/// Files of host_tool/page that the page of the rig is made of; those of `nodal look` are not served here.
constexpr std::array<std::string_view, 16> kPageFiles{
    "rig.html",     "skew_chart.js", "rig.css",        "rig.js",          "rig_controls.js", "rig_takes.js",
    "gyroscope.js", "headset.js",    "live.js",        "camera.js",       "input.js",        "projection.js",
    "stage.js",     "mesh_split.js", "sphere_view.js", "vendor/viewer.js"};
/// Those of the page that pairs a device, which anybody may read.
constexpr std::array<std::string_view, 3> kOpenFiles{"pair.js", "rig.css", "icon.svg"};

template <class Names>
bool is_among(const Names& names, std::string_view name) {
  return std::ranges::find(names, name) != names.end();
}

Answer page(const std::string& name) {
  std::optional<Answer> file = look::page_file(name);
  return file ? std::move(*file) : Answer::text(404, "There is no such page.");
}

unsigned status_of(Errc code) {
  switch (code) {
    case Errc::kBadValue:
    case Errc::kBadFormat:
    case Errc::kTruncated:
    case Errc::kTooLarge: return 400;
    case Errc::kUnsupported: return 403;
    case Errc::kNotFound: return 404;
    case Errc::kBusy:
    case Errc::kExists:
    case Errc::kNotReady:
    case Errc::kWrongState: return 409;
    case Errc::kOverload:
    case Errc::kUnreachable:
    case Errc::kLinkClosed:
    case Errc::kTimeout: return 503;
    default: return 502;
  }
}

Answer refused(const Error& error) { return Answer::text(status_of(error.code), error.message); }

Answer plain(std::string text) {
  Answer answer = Answer::text(200, text);
  answer.type = "text/plain; version=0.0.4; charset=utf-8";
  return answer;
}

/// The number at the begin of a path, and what stands after the slash behind it.
std::optional<std::pair<std::uint64_t, std::string>> numbered(std::string_view path) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(path.data(), path.data() + path.size(), number);
  if (error != std::errc() || path.starts_with('+')) return std::nullopt;
  const std::string_view rest = path.substr(static_cast<std::size_t>(end - path.data()));
  if (rest.empty()) return std::pair(number, std::string());
  if (!rest.starts_with('/') || rest.size() == 1) return std::nullopt;
  return std::pair(number, std::string(rest.substr(1)));
}

std::optional<std::string> only_value(const Wanted& wanted, std::string_view header) {
  const std::vector<std::string> values = look::values_of(wanted.asked, header);
  return values.size() == 1 ? std::optional(values.front()) : std::nullopt;
}

std::string type_of(const std::string& file) {
  if (has_ending(file, ".json")) return "application/json";
  if (has_ending(file, ".jpg")) return "image/jpeg";
  return has_ending(file, ".mkv") ? "video/x-matroska" : "application/octet-stream";
}

Json state_json(const RigDesk::State& state) {
  Json heads = to_json(state.heads);
  return {{"status", to_json(state.status, state.rig_name, "")},
          {"heads", heads["heads"]},
          {"exposure", to_json(state.exposure)}};
}

}  // namespace

Web::Web(RigDesk::Connect connect, std::filesystem::path devices)
    : Web(std::move(connect), std::move(devices), std::nullopt) {}

Web::Web(RigDesk::Connect connect, Device owner) : Web(std::move(connect), {}, std::optional(std::move(owner))) {}

Web::Web(RigDesk::Connect connect, std::filesystem::path devices, std::optional<Device> owner)
    : devices_(std::move(devices)),
      owner_(std::move(owner)),
      desk_(connect),
      downloads_(std::make_unique<Downloads>(connect, [this] { wake(); })),
      live_(std::make_unique<look::LiveRig>(connect)) {
  live_->on_newer([this] { wake(); });
}

Web::~Web() { live_->on_newer({}); }

void Web::set_server(look::Server* server) {
  const std::lock_guard lock(server_mutex_);
  server_ = server;
}

void Web::wake() {
  const std::lock_guard lock(server_mutex_);
  if (server_ != nullptr) server_->wake();
}

std::optional<Device> Web::device_of(const Wanted& wanted) {
  if (owner_) return owner_;
  if (const auto cookie = only_value(wanted, "Cookie")) {
    if (const auto secret = secret_of_cookie(*cookie, kCookie)) return devices_.find(*secret);
  }
  if (wanted.changes) return std::nullopt;  // a bearer token is for programs that read
  const auto header = only_value(wanted, "Authorization");
  const auto secret = header ? secret_of_bearer(*header) : std::nullopt;
  return secret ? devices_.find(*secret) : std::nullopt;
}

Answer Web::respond(const Wanted& wanted) {
  const std::string& name = wanted.name;
  if (wanted.changes) return name == "api/pair" && !owner_ ? pair(wanted) : change(wanted);
  if (name == "healthz") {
    Answer answer;
    answer.work = [this] { return desk_.state() ? plain("ok\n") : Answer::text(503, "The rig does not answer.\n"); };
    return answer;
  }
  if (name == "pair" && !owner_) return page("pair.html");
  if (is_among(kOpenFiles, name)) return page(name);
  const std::optional<Device> device = device_of(wanted);
  if (!device) {
    Answer answer = name.empty() ? page("pair.html") : Answer::text(401, "This device is not paired with the rig.");
    answer.status = 401;
    return answer;
  }
  return read(wanted, *device);
}

Answer Web::read(const Wanted& wanted, const Device& device) {
  const std::string& name = wanted.name;
  if (name.empty()) return page("rig.html");
  if (is_among(kPageFiles, name)) return page(name);
  if (name == "live") return live_->answer(wanted);
  if (name == "scene.json" || name == "mesh.glb") return scene(wanted);
  if (name == "api/me") {
    return look::document({{"device", device.number}, {"name", device.name}, {"rights", rights_name(device.rights)}});
  }
  Answer answer;
  const auto from_state = [&](auto make) {
    answer.work = [this, make] {
      const auto state = desk_.state();
      return state ? make(*state) : refused(state.error());
    };
    return answer;
  };
  using State = RigDesk::State;
  if (name == "api/status")
    return from_state([](const State& state) { return look::document(to_json(state.status, state.rig_name, "")); });
  if (name == "api/state") return from_state([](const State& state) { return look::document(state_json(state)); });
  if (name == "metrics") {
    answer.work = [this] {
      const auto state = desk_.state();
      return plain(state ? metrics_text(*state) : metrics_without_rig());
    };
    return answer;
  }
  if (name == "api/takes") {
    answer.work = [this] {
      const auto takes = desk_.takes();
      if (!takes) return refused(takes.error());
      Json list = Json::array();
      for (const wire::TakeEntry& take : takes->takes()) list.push_back(to_json(take));
      return look::document({{"takes", list}});
    };
    return answer;
  }
  if (name.starts_with(kThumbs)) {
    const auto number = numbered(std::string_view(name).substr(kThumbs.size()));
    if (!number || !number->second.empty()) return Answer::text(404, "There is no such picture.");
    answer.work = [this, take = number->first] {
      auto bytes = desk_.small_file(take, take::kThumbFile, kMaxThumbnail);
      if (!bytes) return refused(bytes.error());
      return Answer{200, "image/jpeg", std::make_shared<const std::vector<std::uint8_t>>(std::move(*bytes))};
    };
    return answer;
  }
  if (name.starts_with(kTakes)) {
    if (device.rights != Rights::kOperate)
      return Answer::text(403, "This device may only watch; takes are for devices that operate the rig.");
    return take(wanted);
  }
  return Answer::text(404, "There is nothing of this name.");
}

Answer Web::scene(const Wanted& wanted) {
  const auto newest = live_->newest();
  if (!newest && wanted.waited < kFirstPicture) {
    Answer answer;
    answer.waits = true;
    return answer;
  }
  if (!newest) return Answer::text(503, "The rig has sent no picture yet.");
  Answer answer;
  answer.work = [this, wanted, raymap = *newest] {
    const std::string of = fmt::format("{} {}x{}", raymap.meta.layout, raymap.meta.width, raymap.meta.height);
    if (sphere_ == nullptr || of != sphere_of_) {
      look::Sphere::Options options{"rig", "", look::usual_envelopes(), 1};
      options.film = look::film_of(raymap.bytes, raymap.meta.layout);
      options.live = true;
      auto read = look::Sphere::read(options);
      if (!read) return refused(read.error());
      sphere_ = std::move(*read);
      sphere_of_ = of;
    }
    return sphere_->answer(wanted);
  };
  return answer;
}

Answer Web::take(const Wanted& wanted) {
  const auto named = numbered(std::string_view(wanted.name).substr(kTakes.size()));
  if (!named || (!named->second.empty() && !take::is_take_file(named->second)))
    return Answer::text(404, "No take has such a file.");
  Answer answer;
  answer.work = [this, wanted, number = named->first, file = named->second] {
    if (!file.empty()) return take_file(wanted, number, file);
    const auto files = desk_.files(number);
    if (!files) return refused(files.error());
    Json list = Json::array();
    for (const take::Manifest::File& each : *files)
      list.push_back({{"name", each.name}, {"bytes", each.bytes}, {"xxh3_128_of_pieces", take::to_hex(each.digest)}});
    return look::document({{"take", number}, {"files", list}});
  };
  return answer;
}

Answer Web::take_file(const Wanted& wanted, std::uint64_t number, const std::string& file) {
  const auto files = desk_.files(number);
  if (!files) return refused(files.error());
  const auto entry = std::ranges::find(*files, file, &take::Manifest::File::name);
  if (entry == files->end()) return Answer::text(404, "This take has no such file.");
  // The rig never writes over a finished take, so that the digest names the bytes: a download that stopped goes on.
  const std::string tag = "\"" + take::to_hex(entry->digest) + "\"";
  const auto condition = only_value(wanted, "If-Range");
  const auto range = only_value(wanted, "Range");
  const ParsedRange parsed =
      range && (!condition || *condition == tag) ? parse_range(*range, entry->bytes) : ParsedRange{};
  Answer answer{200, type_of(file), std::make_shared<const std::vector<std::uint8_t>>()};
  answer.headers = {
      {"Accept-Ranges", "bytes"},
      {"ETag", tag},
      {"Content-Disposition", fmt::format("attachment; filename=\"{}-{}\"", take::take_folder(number), file)}};
  ByteRange wanted_bytes{0, entry->bytes};
  if (parsed.kind == RangeKind::kOutside) {
    answer.status = 416;
    answer.headers.emplace_back("Content-Range", fmt::format("bytes */{}", entry->bytes));
    return answer;
  }
  if (parsed.kind == RangeKind::kPart) {
    wanted_bytes = parsed.range;
    answer.status = 206;
    answer.headers.emplace_back(
        "Content-Range",
        fmt::format("bytes {}-{}/{}", wanted_bytes.begin, wanted_bytes.begin + wanted_bytes.length - 1, entry->bytes));
  }
  if (wanted_bytes.length == 0) return answer;
  auto pieces = downloads_->start(number, file, wanted_bytes);
  if (!pieces) return refused(pieces.error());
  answer.pieces = std::move(*pieces);
  return answer;
}

Answer Web::pair(const Wanted& wanted) {
  const auto shape = JsonShape::object(
      {{"code", JsonShape::value(Devices::kCodeDigits)}, {"name", JsonShape::value(Devices::kMaxName + 1)}});
  const auto said = parse_strict_json(wanted.body, {kMaxOperationBytes, 2}, shape);
  if (!said) return refused(said.error());
  const auto text = [&](const char* key) {
    const auto found = said->is_object() ? said->find(key) : said->end();
    return found != said->end() && found->is_string() ? found->get<std::string>() : "";
  };
  const auto paired = devices_.pair(text("code"), text("name"));
  if (!paired) return refused(paired.error());
  Answer answer = look::document({{"name", paired->device.name}, {"rights", rights_name(paired->device.rights)}});
  answer.headers.emplace_back("Set-Cookie", fmt::format("{}={}; Path=/; Secure; HttpOnly; SameSite=Strict; Max-Age={}",
                                                        kCookie, paired->secret, Devices::kIdle.count()));
  return answer;
}

Answer Web::change(const Wanted& wanted) {
  const std::optional<Device> device = device_of(wanted);
  if (!device) return Answer::text(401, "This device is not paired with the rig.");
  if (device->rights != Rights::kOperate) return Answer::text(403, "This device may only watch.");
  if (!wanted.name.starts_with(kApi)) return Answer::text(404, "There is nothing of this name.");
  auto request = operation(std::string_view(wanted.name).substr(kApi.size()), wanted.body);
  if (!request) return refused(request.error());
  Answer answer;
  answer.work = [this, request = std::move(*request), device = *device] {
    const auto reply =
        desk_.change(request, owner_ ? device.name : fmt::format("{} (device {})", device.name, device.number));
    if (!reply) return refused(reply.error());
    Json done{{"done", true}};
    if (reply->has_take()) done["take"] = reply->take().take();
    constexpr std::size_t kMaxReason = 500;
    if (!reply->not_stored().empty()) done["not_stored"] = printable(reply->not_stored(), kMaxReason);
    if (!reply->not_recorded().empty()) done["not_recorded"] = printable(reply->not_recorded(), kMaxReason);
    return look::document(done);
  };
  return answer;
}

}  // namespace nodal::host::web
