#include "tests/fuzz/guest.h"

#include <algorithm>
#include <array>

namespace nodal::fuzz {
namespace {

/// A correct host keeps only few replies that nothing takes.
constexpr std::size_t kRepliesKept = 4;
constexpr std::size_t kUnsentKept = 256U << 10;

bool changes_calibration(const wire::Request& request) {
  return request.has_upload_commit() || request.has_calibration_use() || request.has_calibration_rollback() ||
         request.has_trial_end();
}

}  // namespace

Guest::Guest(hal::sim::SimLinkListener& listener, std::string name)
    : link_(listener.connect()), session_(Role::kHost, make_hello(std::move(name))) {}

std::optional<std::uint64_t> Guest::post(wire::Request request, Duration served) {
  if (dead()) return std::nullopt;
  request.set_id(next_id_);
  if (!session_.send(request)) return std::nullopt;
  open_[next_id_] = {served, changes_calibration(request)};
  return next_id_++;
}

void Guest::send_item(std::string meta, std::vector<std::uint8_t> body) {
  const auto stream = session_.open_stream(StreamPolicy::kLossless);
  if (!stream) return;
  BulkItem item;
  item.meta = std::move(meta);
  item.body = std::make_shared<const std::vector<std::uint8_t>>(std::move(body));
  (void)session_.offer(*stream, std::move(item));
  session_.close_stream(*stream);
}

bool Guest::read_some() {
  static std::array<std::uint8_t, 16384> bytes;
  const auto read = link_->read(bytes);
  if (!read) {
    gone_ = true;
    return false;
  }
  if (*read == 0 || !session_.receive(std::span(bytes).first(*read))) return false;
  while (auto event = session_.next_event()) {
    const auto* reply = std::get_if<wire::Reply>(&*event);
    if (!reply) continue;
    ++replies_seen_;
    open_.erase(reply->id());
    replies_[reply->id()] = *reply;
    if (replies_.size() > kRepliesKept) replies_.erase(replies_.begin());
  }
  return true;
}

bool Guest::pump() {
  if (gone_) return false;
  bool any = false;
  while (reading_ && !gone_ && session_.wants_input() && read_some()) any = true;
  while (!gone_ && !session_.output().empty()) {
    const auto wrote = link_->write(session_.output());
    gone_ |= !wrote.has_value();
    if (!wrote || *wrote == 0) break;
    session_.sent(*wrote);
    any = true;
  }
  return any;
}

void Guest::set_reading(bool reading, Duration served) {
  reading_ = reading;
  for (auto& [id, asked] : open_) asked.at = served;
}

std::optional<wire::Reply> Guest::take_reply(std::uint64_t id) {
  const auto found = replies_.find(id);
  if (found == replies_.end()) return std::nullopt;
  wire::Reply reply = std::move(found->second);
  replies_.erase(found);
  return reply;
}

std::optional<Duration> Guest::longest_wait(Duration served) const {
  if (dead() || !reading_) return std::nullopt;
  std::optional<Duration> longest;
  for (const auto& [id, asked] : open_) {
    if (!asked.may_take_long) longest = std::max(longest.value_or(Duration()), served - asked.at);
  }
  return longest;
}

Vandal::Vandal(hal::sim::SimLinkListener& listener) : link_(listener.connect()) {
  const std::string hello = make_hello("a vandal").SerializeAsString();
  send_frame(static_cast<std::uint8_t>(FrameType::kHello), 0,
             std::span(reinterpret_cast<const std::uint8_t*>(hello.data()), hello.size()));
}

void Vandal::send_frame(std::uint8_t type, std::uint32_t stream, std::span<const std::uint8_t> payload) {
  const FrameHeader header{static_cast<FrameType>(type), 0, stream, sequence_++};
  payload = payload.first(std::min(payload.size(), max_payload_bytes(header.type)));  // the encoder asserts this limit
  send_bytes(encode_frame_header(header, payload));
  send_bytes(payload);
}

void Vandal::send_bytes(std::span<const std::uint8_t> bytes) {
  if (unsent_.size() + bytes.size() <= kUnsentKept) unsent_.insert(unsent_.end(), bytes.begin(), bytes.end());
}

bool Vandal::pump() {
  static std::array<std::uint8_t, 16384> bytes;
  bool any = false;
  while (!gone_) {
    const auto read = link_->read(bytes);
    gone_ |= !read.has_value();
    if (!read || *read == 0) break;
    any = true;
  }
  while (!gone_ && !unsent_.empty()) {
    const auto wrote = link_->write(unsent_);
    gone_ |= !wrote.has_value();
    if (!wrote || *wrote == 0) break;
    unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(*wrote));
    any = true;
  }
  return any;
}

}  // namespace nodal::fuzz
