#include "nodald_process.h"

#include <poll.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdlib>
#include <fstream>

#include "hal/linux/link/socket_link.h"
#include "protocol/upload.h"
#include "tests/scenario/small_rig.h"
#include "tests/support/process.h"

namespace nodal::crash {
namespace {

using Clock = std::chrono::steady_clock;

Clock::time_point in_seconds(int count) { return Clock::now() + std::chrono::seconds(count); }

void wait_a_moment() { ::poll(nullptr, 0, 2); }

}  // namespace

RigFolder::RigFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "nodald-XXXXXX").string();
  path = ::mkdtemp(name.data());
  std::ofstream(path / "truth.json") << to_json(scenario::small_calibration("truth"));
  std::ofstream rig(path / "rig.toml");
  rig << "[rig]\nname = \"process\"\n[raymap]\nwidth = 256\nheight = 128\n[links]\nunix = \"sock\"\n"
         "[store]\nfolder = \"store\"\n[sim]\ncalibration = \"truth.json\"\n";
  for (int i = 0; i < scenario::kHeads; ++i) {
    rig << "[[heads]]\nname = \"cam" << i << "\"\nport = \"sim:cam" << i << "\"\n";
  }
}

RigFolder::~RigFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path, ignored);
}

RecordingRig::RecordingRig(const std::string& takes, const std::string& more) {
  std::ofstream(config(), std::ios::app) << "[takes]\nfolder = \"" << takes << "\"\nbuffer_mb = 16\n" << more;
}

std::vector<std::string> nodald(std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), NODAL_BIN_DIR "/nodald");
  return arguments;
}

LinkHost::LinkHost(std::unique_ptr<hal::LinkPort> link)
    : link_(std::move(link)), session_(Role::kHost, make_hello("a test")) {}

std::unique_ptr<LinkHost> LinkHost::connect(const std::string& socket, int seconds) {
  for (const auto end = in_seconds(seconds); Clock::now() < end; wait_a_moment()) {
    auto link = hal::connect_link("unix:" + socket);
    if (link) return std::make_unique<LinkHost>(std::move(*link));
  }
  return nullptr;
}

bool LinkHost::pump() {
  std::array<std::uint8_t, 65536> bytes;
  bool any = false;
  const auto read = link_->read(bytes);
  if (!read || (*read > 0 && !session_.receive(std::span(bytes).first(*read)))) return false;
  any = *read > 0;
  while (auto event = session_.next_event()) {
    if (auto* reply = std::get_if<wire::Reply>(&*event)) replies_.push_back(*reply);
    if (auto* piece = std::get_if<BulkPiece>(&*event)) raymaps += piece->last ? 1 : 0;
  }
  while (!session_.output().empty()) {
    const auto wrote = link_->write(session_.output());
    if (!wrote) return false;
    if (*wrote == 0) break;
    session_.sent(*wrote);
    any = true;
  }
  if (!any) wait_a_moment();
  return true;
}

void LinkHost::post(wire::Request request) {
  request.set_id(next_id_++);
  (void)session_.send(request);
}

std::optional<wire::Reply> LinkHost::take_reply(std::uint64_t id) {
  for (auto reply = replies_.begin(); reply != replies_.end(); ++reply) {
    if (reply->id() != id) continue;
    wire::Reply taken = *reply;
    replies_.erase(reply);
    return taken;
  }
  return std::nullopt;
}

std::optional<wire::Reply> LinkHost::ask(wire::Request request, int seconds) {
  post(std::move(request));
  const std::uint64_t id = last_id();
  for (const auto end = in_seconds(seconds); Clock::now() < end;) {
    if (auto reply = take_reply(id)) return reply;
    if (!pump()) return std::nullopt;
  }
  return std::nullopt;
}

std::optional<wire::Reply> LinkHost::ask(const std::function<void(wire::Request&)>& fill) {
  wire::Request request;
  fill(request);
  return ask(std::move(request));
}

std::optional<wire::RigStatus> LinkHost::status() {
  wire::Request request;
  request.mutable_status();
  const auto reply = ask(request);
  if (!reply) return std::nullopt;
  return reply->status();
}

bool LinkHost::wait_for(const std::function<bool(const wire::RigStatus&)>& holds) {
  bool held = false;
  return test::wait_until([&] {
           const auto now = status();
           if (!now) return true;
           held = holds(*now);
           return held || !pump();
         }) &&
         held;
}

bool LinkHost::upload_and_commit(const std::string& document) {
  const UploadSender sender(std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end()));
  wire::Request begin;
  *begin.mutable_upload_begin() = sender.begin();
  const auto state = ask(begin);
  if (!state || !state->has_upload()) return false;
  const auto stream = session_.open_stream(StreamPolicy::kLossless);
  if (!stream || !session_.offer(*stream, *sender.item(state->upload().offset()))) return false;
  session_.close_stream(*stream);
  while (session_.counts(*stream)) {
    if (!pump()) return false;
  }
  wire::Request commit;
  *commit.mutable_upload_commit() = sender.commit();
  post(commit);
  return true;
}

}  // namespace nodal::crash
