#include "besieged.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <iterator>
#include <map>

#include "hal/linux/link/socket_link.h"
#include "nodald_process.h"

namespace nodal::crash {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kTriesAgainAfter = 50ms;
constexpr auto kSamplesEvery = 500ms;
constexpr auto kSettlesWithin = 90s;
constexpr std::uint64_t kExposureNs = 8'000'000;

std::string read_file(const fs::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::uint64_t size_of(const fs::path& path) {
  std::error_code none;
  const std::uintmax_t size = fs::file_size(path, none);
  return none ? 0 : size;
}

/// The value of `key = "value"` in a TOML text.
std::string toml_value(const std::string& text, const std::string& key) {
  const std::size_t line = text.find("\n" + key + " = \"");
  if (line == std::string::npos) return {};
  const std::size_t begin = text.find('"', line) + 1;
  return text.substr(begin, text.find('"', begin) - begin);
}

std::string with_value(std::string text, const std::string& key, const std::string& value) {
  const std::size_t line = text.find("\n" + key + " = \"");
  if (line == std::string::npos) return text;
  const std::size_t begin = text.find('"', line) + 1;
  return text.replace(begin, text.find('"', begin) - begin, value);
}

std::map<std::string, std::uint64_t> losses_of(const wire::RigStatus& status) {
  std::map<std::string, std::uint64_t> all;
  for (const wire::Count& count : status.set_losses()) all[count.reason()] += count.frames();
  return all;
}

std::string lost_between(const wire::RigStatus& first, const wire::RigStatus& last) {
  const auto before = losses_of(first);
  std::string text;
  for (const auto& [reason, sets] : losses_of(last)) {
    const auto found = before.find(reason);
    const std::uint64_t more = sets - (found == before.end() ? 0 : found->second);
    if (more > 0) text += (text.empty() ? "" : ", ") + reason + " " + std::to_string(more);
  }
  return text.empty() ? "none" : text;
}

}  // namespace

Besieged::Besieged(const fs::path& rig) {
  std::string name = (fs::temp_directory_path() / "siege-XXXXXX").string();
  folder_ = ::mkdtemp(name.data());
  std::string toml = read_file(rig / "rig.toml");
  const std::string calibration = toml_value(toml, "calibration");
  document_ = read_file(rig / calibration);
  std::ofstream(folder_ / "truth.json") << document_;
  toml = with_value(with_value(with_value(toml, "calibration", "truth.json"), "unix", "sock"), "folder", "store");
  std::ofstream(folder_ / "rig.toml") << toml;
  steady_.every = 250ms;
  newcomer_.every = 5s;
  newcomer_.newcomer = true;
}

Besieged::~Besieged() {
  nodald_.reset();
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

bool Besieged::start() {
  // Logs to a file, because a full pipe would block it.
  nodald_.emplace(std::vector<std::string>{"/bin/sh", "-c", "exec \"$0\" --config \"$1\" 2>\"$2\"", nodald({}).front(),
                                           (folder_ / "rig.toml").string(), (folder_ / "log").string()});
  return set_up();
}

bool Besieged::set_up() {
  const auto host = LinkHost::connect(socket(), 300);
  const auto done = [&](const wire::Request& request) {
    const auto reply = host->ask(request);
    if (reply && !reply->has_error()) return true;
    why_ = reply ? reply->error().message() : "nodald does not answer: " + read_file(folder_ / "log");
    return false;
  };
  why_ = "nodald is not there: " + read_file(folder_ / "log");
  if (!host || !host->upload_and_commit(document_)) return false;
  wire::Request heads, exposure, genlock;
  genlock.mutable_genlock();
  if (!genlock_) {
    const auto shown = host->ask(genlock);
    if (!shown || !shown->has_genlock()) return false;
    genlock_ = shown->genlock();
  }
  exposure.mutable_exposure()->set_program("manual");
  heads.mutable_head_set()->set_exposure_ns(kExposureNs);
  heads.mutable_head_set()->set_gain_mdb(0);
  heads.mutable_head_set()->set_gamma(0);
  genlock.mutable_genlock()->set_action(wire::GenlockRequest::START);
  genlock.mutable_genlock()->set_rate_numerator(genlock_->rate_numerator());
  genlock.mutable_genlock()->set_rate_denominator(genlock_->rate_denominator());
  if (!done(exposure) || !done(heads) || !done(genlock)) return false;
  // On a machine that is too slow the rig never reports "running"; the settings must be in effect all the same.
  bool in_effect = false;
  for (const auto end = Clock::now() + kSettlesWithin; Clock::now() < end; ::poll(nullptr, 0, 100)) {
    const auto status = host->status();
    if (!status) return false;
    why_ = "the rig is " + status->state() + ", its genlock " + status->genlock().state() + ": " + status->problem();
    in_effect = status->genlock().state() == "locked" && status->raymaps() > 0;
    if (in_effect && status->state() == "running") return true;
  }
  return in_effect;
}

std::unique_ptr<swarm::Line> Besieged::connect() const {
  auto link = hal::connect_link("unix:" + socket());
  return link ? std::make_unique<swarm::Line>(std::move(*link), "a good client") : nullptr;
}

std::optional<PhaseReport> Besieged::watch(const std::string& phase, std::chrono::seconds how_long) {
  report_ = {};
  report_.name = phase;
  first_status_.reset();
  const auto begin = Clock::now();
  const std::uint64_t log_before = size_of(folder_ / "log");
  for (Asker* asker : {&steady_, &newcomer_}) {
    if (!asker->asked) asker->due = begin;
  }
  auto next_sample = begin;
  while (Clock::now() < begin + how_long) {
    turn();
    if (Clock::now() >= next_sample) {
      sample();
      next_sample += kSamplesEvery;
    }
    ::poll(nullptr, 0, 1);
  }
  // A pending request has waited at least until now.
  for (const Asker* asker : {&steady_, &newcomer_}) {
    if (Clock::now() > asker->due) {
      report_.latencies_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - asker->due).count());
    }
  }
  std::sort(report_.latencies_ms.begin(), report_.latencies_ms.end());
  report_.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  report_.log_bytes = size_of(folder_ / "log") - log_before;
  report_.settings_bytes = size_of(folder_ / "store" / "settings");
  if (!first_status_ || !status_) {
    why_ = "no status came during '" + phase + "'";
    return std::nullopt;
  }
  report_.sets = status_->sets() - first_status_->sets();
  report_.lost = lost_between(*first_status_, *status_);
  return report_;
}

void Besieged::turn() {
  const auto now = Clock::now();
  turn_of_puller(now);
  turn_of(steady_, now);
  turn_of(newcomer_, now);
}

void Besieged::turn_of_puller(Clock::time_point now) {
  if (puller_ && puller_->dead()) {
    ++report_.reconnects;
    puller_.reset();
    next_pull_ = now + kTriesAgainAfter;
  }
  if (!puller_) {
    if (now < next_pull_) return;
    puller_ = connect();
    next_pull_ = now + kTriesAgainAfter;
    if (!puller_) return;
    wire::Request request;
    request.set_id(next_id_++);
    request.mutable_pull();  // JPEG, newest only, until stopped
    (void)puller_->session().send(request);
  }
  bool refused = false;
  while (auto event = puller_->take()) {
    if (const auto* piece = std::get_if<BulkPiece>(&*event)) report_.raymaps += piece->last ? 1 : 0;
    if (const auto* reply = std::get_if<wire::Reply>(&*event)) refused |= reply->has_error();
    refused |= std::holds_alternative<StreamClosed>(*event);
  }
  puller_->write();
  if (!refused) return;
  puller_.reset();
  next_pull_ = now + kTriesAgainAfter;
}

void Besieged::turn_of(Asker& asker, Clock::time_point now) {
  if (asker.line && asker.line->dead()) {
    ++report_.reconnects;
    asker.line.reset();
    asker.asked.reset();
    asker.next_try = now + kTriesAgainAfter;
  }
  if (!asker.asked && now >= asker.due && now >= asker.next_try) {
    if (!asker.line) asker.line = connect();
    asker.next_try = now + kTriesAgainAfter;
    if (!asker.line) return;
    wire::Request request;
    request.set_id(next_id_++);
    request.mutable_status();
    if (asker.line->session().send(request)) asker.asked = request.id();
  }
  if (!asker.line) return;
  while (auto event = asker.line->take()) {
    const auto* reply = std::get_if<wire::Reply>(&*event);
    if (!reply || reply->id() != asker.asked) continue;
    asker.asked.reset();
    if (!reply->has_status()) continue;  // refused; it tries again
    status_ = reply->status();
    if (!first_status_) first_status_ = status_;
    report_.latencies_ms.push_back(std::chrono::duration<double, std::milli>(Clock::now() - asker.due).count());
    asker.due = now + asker.every;
  }
  asker.line->write();
  if (asker.newcomer && !asker.asked) asker.line.reset();
}

void Besieged::sample() {
  std::ifstream statm("/proc/" + std::to_string(nodald_->pid()) + "/statm");
  std::uint64_t total = 0;
  std::uint64_t resident = 0;
  statm >> total >> resident;
  report_.resident_bytes =
      std::max(report_.resident_bytes, resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)));
  std::error_code gone;
  const auto entries = fs::directory_iterator("/proc/" + std::to_string(nodald_->pid()) + "/fd", gone);
  if (!gone)
    report_.descriptors = std::max<std::uint64_t>(report_.descriptors, std::distance(begin(entries), end(entries)));
}

int Besieged::stop() {
  puller_.reset();
  steady_.line.reset();
  newcomer_.line.reset();
  nodald_->signal(SIGTERM);
  return nodald_->wait(20s).code;
}

}  // namespace nodal::crash
