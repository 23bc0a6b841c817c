#include "tests/sim/good_client.h"

#include <algorithm>

namespace nodal::swarm {
namespace {

constexpr Duration kTriesAgainAfter = Duration::milliseconds(50);
constexpr std::array<std::string_view, 4> kNames = {"status", "setting", "upload", "next raymap"};

std::span<const std::uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

}  // namespace

GoodClient::GoodClient(hal::sim::SimLinkListener& listener, Oracle& oracle, Documents& documents, Tally& tally,
                       bool visitor, std::uint64_t seed, Instant now)
    : listener_(listener),
      oracle_(oracle),
      documents_(documents),
      tally_(tally),
      visitor_(visitor),
      random_(seed, "good client"),
      lossless_(random_.chance(500'000)) {
  tasks_[kStatus].every = Duration::seconds(1);
  tasks_[kSetting].every = Duration::seconds(3);
  tasks_[kUpload].every = Duration::seconds(5);
  tasks_[kPull].every = Duration();  // one raymap after another
  for (Task& task : tasks_) task.due = task.next_try = now;
}

void GoodClient::connect() {
  line_ = std::make_unique<Line>(listener_.connect(), "a good client");
  for (Task& task : tasks_) task.asked.reset();
  uploading_.reset();
}

void GoodClient::pump(Instant now) {
  if (line_ && line_->dead()) {
    ++tally_.good_dropped;
    line_.reset();
    for (Task& task : tasks_) {
      task.asked.reset();
      task.next_try = std::max(task.next_try, now + kTriesAgainAfter);
    }
  }
  const int tasks = visitor_ ? 1 : kWhats;
  for (int i = 0; i < tasks; ++i) {
    Task& task = tasks_[static_cast<std::size_t>(i)];
    if (task.asked || now < task.due || now < task.next_try) continue;
    if (!line_) connect();
    start(static_cast<What>(i), task);
  }
  if (!line_) return;
  while (line_) {
    auto event = line_->take();
    if (!event) break;
    if (const auto* reply = std::get_if<wire::Reply>(&*event)) {
      take(*reply, now);
    } else if (const auto* piece = std::get_if<BulkPiece>(&*event)) {
      take(*piece, now);
    } else if (const auto* closed = std::get_if<StreamClosed>(&*event)) {
      if (lossless_ && closed->error)
        oracle_.fail("a good client's lossless pull was ended: " + closed->error->message);
      retry(tasks_[kPull], now);
    } else if (std::holds_alternative<StreamStopped>(*event)) {
      uploading_.reset();
      retry(tasks_[kUpload], now);
    }
  }
  if (!line_) return;
  commit_when_sent();
  line_->write();
}

void GoodClient::start(What what, Task& task) {
  wire::Request request;
  request.set_id(next_id_++);
  switch (what) {
    case kStatus: request.mutable_status(); break;
    case kSetting: request.mutable_head_set()->set_exposure_ns(1'000'000 * (1 + random_.below(20))); break;
    case kUpload: {
      document_ = random_.below(kCalibrations);
      const std::string& json = documents_.json[document_];
      request.mutable_upload_begin()->set_length(json.size());
      request.mutable_upload_begin()->set_sha256(sha256_to_wire(sha256(bytes_of(json))));
      break;
    }
    case kPull:
      request.mutable_pull()->set_coding(wire::PullRequest::RAW);
      request.mutable_pull()->set_lossless(lossless_);
      newest_set_.reset();
      break;
  }
  if (line_->session().send(request)) task.asked = request.id();
}

void GoodClient::take(const wire::Reply& reply, Instant now) {
  const auto found =
      std::find_if(tasks_.begin(), tasks_.end(), [&](const Task& task) { return task.asked == reply.id(); });
  if (found == tasks_.end()) return;  // from an earlier connection
  const auto what = static_cast<What>(found - tasks_.begin());
  if (reply.has_error()) return retry(*found, now);
  if (what == kUpload) return take_upload(reply, *found, now);
  if (what != kPull) done(what, now);
}

void GoodClient::take_upload(const wire::Reply& reply, Task& task, Instant now) {
  if (reply.has_done()) {
    ++tally_.uploads;
    documents_.sure = static_cast<int>(document_);
    documents_.maybe = {};
    return done(kUpload, now);
  }
  const std::string& json = documents_.json[document_];
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(json.begin(), json.end());
  const auto item = UploadSender(bytes).item(reply.upload().offset());
  const auto stream = line_->session().open_stream(StreamPolicy::kLossless);
  if (!item || !stream || !line_->session().offer(*stream, *item)) return retry(task, now);
  line_->session().close_stream(*stream);
  uploading_ = *stream;
}

/// Control frames overtake bulk frames: the commit waits until the last byte has been sent.
void GoodClient::commit_when_sent() {
  if (!uploading_ || line_->session().counts(*uploading_)) return;
  wire::Request request;
  request.set_id(next_id_++);
  request.mutable_upload_commit()->set_sha256(sha256_to_wire(sha256(bytes_of(documents_.json[document_]))));
  documents_.maybe[document_] = true;
  if (line_->session().send(request)) tasks_[kUpload].asked = request.id();
  uploading_.reset();
}

void GoodClient::take(const BulkPiece& piece, Instant now) {
  if (piece.first) {
    pixels_.clear();
    if (!raymap_.ParseFromString(piece.meta)) return oracle_.fail("a raymap's header cannot be read");
  }
  pixels_.insert(pixels_.end(), piece.data.begin(), piece.data.end());
  if (!piece.last) return;
  oracle_.on_raymap(raymap_, pixels_, documents_.id);
  const std::uint64_t expected = newest_set_.value_or(0) + (raymap_.field() == 0 ? 1 : 0);
  if (lossless_ && newest_set_ && raymap_.set() != expected) {
    oracle_.fail("a good client's lossless pull gave set " + std::to_string(raymap_.set()) + " where " +
                 std::to_string(expected) + " was next");
  }
  newest_set_ = raymap_.set();
  const auto asked = tasks_[kPull].asked;
  done(kPull, now);
  tasks_[kPull].asked = asked;  // the same pull delivers the next one
}

void GoodClient::done(What what, Instant now) {
  Task& task = tasks_[static_cast<std::size_t>(what)];
  ++tally_.good_answers;
  tally_.slowest_good = std::max(tally_.slowest_good, (now - task.due).ns());
  task.asked.reset();
  task.due = task.next_try = now + task.every;
  if (visitor_) line_.reset();
}

void GoodClient::retry(Task& task, Instant now) {
  ++tally_.good_refused;
  task.asked.reset();
  task.next_try = now + kTriesAgainAfter;
}

void GoodClient::check(Instant now, const std::string& beside) {
  const int tasks = visitor_ ? 1 : kWhats;
  for (int i = 0; i < tasks; ++i) {
    const Duration waits = now - tasks_[static_cast<std::size_t>(i)].due;
    if (waits <= kServedWithin) continue;
    return oracle_.fail(std::string(visitor_ ? "a newcomer's " : "a good client's ") +
                        std::string(kNames[static_cast<std::size_t>(i)]) + " is not served within " +
                        std::to_string(kServedWithin.ms()) + " ms, beside " + beside);
  }
}

}  // namespace nodal::swarm
