#include "host_tool/look/live_rig.h"

#include <algorithm>

#include "host_tool/console/interrupt.h"
#include "host_tool/look/numbers.h"
#include "host_tool/rig/received_raymap.h"
#include "host_tool/rig/stream_wait.h"
#include "protocol/base/try.h"

namespace nodal::host::look {
namespace {

constexpr Duration kAgain = Duration::seconds(1);  // between two attempts to connect

std::string in_ascii(std::string text) {
  std::ranges::replace_if(
      text, [](unsigned char c) { return c < 0x20 || c > 0x7E; }, '?');
  return text;
}

}  // namespace

LiveRig::LiveRig(Connect connect) : connect_(std::move(connect)), asked_at_(steady_now()), thread_([this] { run(); }) {}

LiveRig::~LiveRig() {
  stop();
  thread_.join();
}

void LiveRig::stop() {
  const std::lock_guard lock(mutex_);
  stops_ = true;
  changed_.notify_all();
}

void LiveRig::run() {
  while (wait_for_questions()) {
    const Status ended = [&]() -> Status {
      NODAL_TRY_ASSIGN(const std::unique_ptr<RigConnection> rig, connect_());
      return pull(*rig);
    }();
    if (ended) continue;
    say(ended.error().message);
    if (stops(kAgain)) return;
  }
}

bool LiveRig::wanted(Duration now) {
  const std::lock_guard lock(mutex_);
  return now - asked_at_ < kWanted;
}

bool LiveRig::wait_for_questions() {
  while (!wanted(steady_now())) {
    if (stops(Duration::milliseconds(20))) return false;
  }
  return !stops(Duration());
}

Status LiveRig::pull(RigConnection& rig) {
  wire::Request request;
  request.mutable_status();
  const Duration asked = rig.now();
  NODAL_TRY_ASSIGN(const wire::Reply status, rig.ask(request));
  if (const std::uint64_t clock = status.status().clock_ns(); clock != 0) {
    // The rig answered between the two times here: half of their difference is the most that this is wrong by.
    const std::lock_guard lock(mutex_);
    offset_ = Duration::nanoseconds(static_cast<std::int64_t>(clock)) - (asked + (rig.now() - asked) / 2);
  }
  request.mutable_pull()->set_coding(wire::PullRequest::JPEG);
  NODAL_TRY_ASSIGN(const wire::Reply started, rig.ask(request));
  const StreamId stream{started.pull().stream()};
  RaymapAssembly assembly("jpeg");
  StreamWait wait(rig, stream, rig.patience(), "a raymap; `nodal status` says what the rig does");
  while (!stops(Duration()) && wanted(rig.now())) {
    NODAL_TRY_ASSIGN(const Event event, wait.next());
    if (const auto* closed = std::get_if<StreamClosed>(&event))
      return closed->error ? Status(fail(*closed->error)) : Status(fail(Errc::kLinkClosed, "the rig ended the stream"));
    const auto* piece = std::get_if<BulkPiece>(&event);
    if (piece == nullptr) continue;
    NODAL_TRY_ASSIGN(std::optional<media::Raymap> raymap, assembly.add(*piece));
    if (!raymap) continue;
    NODAL_TRY(check_raymap(*raymap));
    keep(*std::move(raymap), rig.now());
    wait.restart();
  }
  rig.stop_stream(stream);
  return {};
}

void LiveRig::keep(media::Raymap raymap, Duration now) {
  {
    const std::lock_guard lock(mutex_);
    newest_.jpeg = std::make_shared<const std::vector<std::uint8_t>>(raymap.bytes);
    newest_.raymap = std::move(raymap);
    ++newest_.number;
    newest_.arrived = now;
    problem_.clear();
    changed_.notify_all();
  }
  const std::lock_guard lock(on_newer_mutex_);
  if (on_newer_) on_newer_();
}

void LiveRig::say(const std::string& problem) {
  const std::lock_guard lock(mutex_);
  problem_ = problem;
}

bool LiveRig::stops(Duration wait) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::nanoseconds(wait.ns()), [&] { return stops_; }) || interrupted();
}

Result<media::Raymap> LiveRig::first(Duration at_most) {
  const Duration end = steady_now() + at_most;
  std::unique_lock lock(mutex_);
  while (newest_.number == 0) {
    asked_at_ = steady_now();
    if (interrupted()) return fail(Errc::kCancelled, "stopped before the rig sent a raymap");
    if (steady_now() > end) return fail(Errc::kTimeout, problem_);
    changed_.wait_for(lock, std::chrono::milliseconds(50));
  }
  return newest_.raymap;
}

void LiveRig::on_newer(std::function<void()> call) {
  const std::lock_guard lock(on_newer_mutex_);
  on_newer_ = std::move(call);
}

std::optional<media::Raymap> LiveRig::newest() {
  const std::lock_guard lock(mutex_);
  asked_at_ = steady_now();
  return newest_.number == 0 ? std::nullopt : std::optional(newest_.raymap);
}

Answer LiveRig::answer(const Wanted& wanted) {
  const std::optional<double> after = number(wanted, "after");
  if (!after) return Answer::text(400, "Give after=N.");
  const std::lock_guard lock(mutex_);
  const Duration now = steady_now();
  asked_at_ = now;
  Answer answer{204, "image/jpeg", std::make_shared<const std::vector<std::uint8_t>>(), {}};
  const bool newer = static_cast<double>(newest_.number) > *after;
  answer.waits = !newer && wanted.waited < kWait;
  if (newer) {
    const Duration exposed = Duration::nanoseconds(static_cast<std::int64_t>(newest_.raymap.meta.mid_exposure_ns));
    const Duration age = offset_ ? now + *offset_ - exposed : now - newest_.arrived;
    answer.status = 200;
    answer.body = newest_.jpeg;
    answer.headers = {{"X-Number", std::to_string(newest_.number)},
                      {"X-Set", std::to_string(newest_.raymap.meta.set)},
                      {"X-Age-Ms", std::to_string(age.ns() / 1'000'000)},
                      {"X-Age-Of", offset_ ? "mid-exposure" : "arrival"},
                      {"X-Clock-Ms", std::to_string(now.ns() / 1'000'000)}};
  }
  if (!problem_.empty()) answer.headers.emplace_back("X-Problem", in_ascii(problem_));
  return answer;
}

}  // namespace nodal::host::look
