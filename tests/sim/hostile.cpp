#include "tests/sim/hostile.h"

#include <algorithm>
#include <array>

#include "protocol/base/crc32c.h"
#include "protocol/upload.h"

namespace nodal::swarm {
namespace {

constexpr Duration kReadsEvery = Duration::seconds(5);
constexpr Duration kConnectsAgainAfter = Duration::milliseconds(20);
constexpr std::size_t kUnknownBytes = 60'000;
constexpr int kRequestsATurn = 6;

/// Field 1000, which no version of the protocol has, with `bytes` bytes.
std::string unknown_field(std::size_t bytes) {
  std::string field = "\xc2\x3e";  // 1000 << 3 | 2 as a varint
  for (std::size_t left = bytes;; left >>= 7) {
    field.push_back(static_cast<char>(left > 127 ? (left & 127) | 128 : left));
    if (left <= 127) break;
  }
  return field + std::string(bytes, 'u');
}

std::string drawn_digest(hal::sim::Random& random) {
  std::string digest(32, '\0');
  for (char& c : digest) c = static_cast<char>(random.below(256));
  return digest;
}

std::vector<std::uint8_t> frame(const FrameHeader& header, const std::string& payload) {
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size());
  const auto head = encode_frame_header(header, bytes);
  std::vector<std::uint8_t> all(head.size() + bytes.size());
  std::copy(bytes.begin(), bytes.end(), std::copy(head.begin(), head.end(), all.begin()));
  return all;
}

/// The same frame with another length and a correct header CRC.
std::vector<std::uint8_t> with_length(std::vector<std::uint8_t> bytes, std::uint32_t length) {
  const auto put = [&](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::uint8_t>(value >> (8 * i));
  };
  put(16, length);
  put(24, crc32c(std::span(bytes).first(24)));
  return bytes;
}

}  // namespace

std::string_view name_of(HostileKind kind) {
  constexpr std::array<std::string_view, kHostileKinds> names = {
      "silent", "idle",     "half-open", "slow reader",    "slow lossless reader",
      "greedy", "flooding", "lying",     "uploading junk", "connect storm"};
  return names[static_cast<std::size_t>(kind)];
}

Hostile::Hostile(HostileKind kind, Connect connect, std::string torn, std::uint64_t unknown_bytes, std::uint64_t seed)
    : kind_(kind),
      connect_(std::move(connect)),
      torn_(std::move(torn)),
      random_(seed, "hostile"),
      bytes_left_(unknown_bytes) {}

void Hostile::act(Instant now) {
  if (line_ && line_->dead()) {
    line_.reset();
    next_connect_ = now + kConnectsAgainAfter;
  }
  if (!line_) {
    if (now >= next_connect_) connect(now);
    return;
  }
  go_on(now);
}

void Hostile::connect(Instant now) {
  const bool narrow =
      kind_ == HostileKind::kSlowReader || kind_ == HostileKind::kSlowLossless || kind_ == HostileKind::kGreedy;
  auto link = connect_(narrow);
  next_connect_ = now + kConnectsAgainAfter;
  if (!link) return;
  line_ = std::make_unique<Line>(std::move(link), "hostile");
  next_turn_ = now + kReadsEvery;
  committing_.reset();
  begin();
}

void Hostile::begin() {
  switch (kind_) {
    case HostileKind::kSilent: return;
    case HostileKind::kHalfOpen: return send_half_a_frame();
    case HostileKind::kSlowReader: pull(false, 1); break;
    case HostileKind::kSlowLossless: pull(true, 1); break;
    case HostileKind::kGreedy: take_everything(); break;
    case HostileKind::kConnectStorm:
      if (random_.chance(500'000)) return;  // half of them send no Hello
      break;
    default: break;
  }
  line_->write();
}

void Hostile::go_on(Instant now) {
  switch (kind_) {
    case HostileKind::kSilent:
    case HostileKind::kHalfOpen:
    case HostileKind::kIdle: read_all(); break;  // to detect when the rig drops it
    case HostileKind::kSlowReader:
    case HostileKind::kSlowLossless:
      line_->write();
      if (now < next_turn_) break;
      next_turn_ = now + kReadsEvery;
      read_all();
      break;
    case HostileKind::kGreedy:
      line_->write();  // fails once the rig has dropped it
      if (now < next_turn_) break;
      next_turn_ = now + kReadsEvery;
      take_everything();
      break;
    case HostileKind::kFlooding: flood(); break;
    case HostileKind::kLying: send_invalid_frame(); break;
    case HostileKind::kJunk: upload_junk(); break;
    case HostileKind::kConnectStorm:
      line_.reset();
      for (int i = 0; i < 2; ++i) {
        if (auto link = connect_(false)) Line(std::move(link), "storm").write();
      }
      break;
  }
}

void Hostile::read_all() {
  while (line_->take()) {}
}

void Hostile::send_half_a_frame() {
  line_->write();  // the Hello
  wire::Request request;
  request.set_id(next_id_++);
  request.mutable_status();
  const auto bytes = frame({FrameType::kRequest, 0, 0, 1}, request.SerializeAsString());
  (void)line_->write_raw(std::span(bytes).first(1 + random_.below(bytes.size() - 1)));
}

void Hostile::pull(bool lossless, int times) {
  for (int i = 0; i < times; ++i) {
    wire::Request request;
    request.set_id(next_id_++);
    request.mutable_pull()->set_coding(random_.chance(700'000) ? wire::PullRequest::RAW : wire::PullRequest::JPEG);
    request.mutable_pull()->set_lossless(lossless);
    (void)line_->session().send(request);
  }
}

void Hostile::take_everything() {
  pull(false, 6);
  for (int i = 0; i < 4; ++i) {
    wire::Request request;
    request.set_id(next_id_++);
    if (i % 2 == 0) {
      request.mutable_frame_set();
    } else {
      request.mutable_upload_begin()->set_length(1U << 20);
      request.mutable_upload_begin()->set_sha256(drawn_digest(random_));
    }
    (void)line_->session().send(request);
  }
  static const auto body = std::make_shared<const std::vector<std::uint8_t>>(4096, std::uint8_t{7});
  while (const auto stream = line_->session().open_stream(StreamPolicy::kLossless)) {
    (void)line_->session().offer(*stream, BulkItem{"no upload part", body, 0});
  }
}

void Hostile::flood() {
  read_all();
  for (int i = 0; i < kRequestsATurn && line_->session().output().size() < 200'000; ++i) {
    wire::Request request = random_.chance(400'000) ? extreme_request() : useless_request();
    request.set_id(next_id_++);
    if (!line_->session().send(request)) break;
  }
  line_->write();
}

/// Requests that cost work and change nothing; some have unknown fields.
wire::Request Hostile::useless_request() {
  wire::Request request;
  switch (random_.below(6)) {
    case 0: request.mutable_status(); break;
    case 1: request.mutable_heads(); break;
    case 2: request.mutable_calibration_list(); break;
    case 3: request.mutable_genlock(); break;
    case 4: request.mutable_calibration_get(); break;
    default: request.mutable_head_set()->add_heads(0); break;  // without a value to set
  }
  if (bytes_left_ < kUnknownBytes || !random_.chance(30'000)) return request;
  bytes_left_ -= kUnknownBytes;
  wire::HeadSetRequest& padded = *request.mutable_head_set();
  padded.add_heads(static_cast<std::uint32_t>(random_.below(2)));
  NODAL_ASSERT(padded.MergeFromString(unknown_field(kUnknownBytes)));
  return request;
}

/// Requests with values that every rig must refuse.
wire::Request Hostile::extreme_request() {
  wire::Request request;
  switch (random_.below(10)) {
    case 0: request.mutable_head_set()->set_exposure_ns(UINT64_MAX); break;
    case 1: request.mutable_head_set()->add_heads(UINT32_MAX); break;
    case 2: request.mutable_head_set()->set_red_q12(UINT32_MAX); break;
    case 3:
      request.mutable_genlock()->set_action(wire::GenlockRequest::START);
      request.mutable_genlock()->set_rate_numerator(UINT32_MAX);
      request.mutable_genlock()->set_rate_denominator(UINT32_MAX - 1);
      break;
    case 4:
      request.mutable_genlock()->set_action(wire::GenlockRequest::START);
      request.mutable_genlock()->set_pulse_width_ns(UINT64_MAX);
      break;
    case 5: request.mutable_exposure()->set_target_below(UINT32_MAX); break;
    case 6: request.mutable_pull_stop()->set_stream(UINT32_MAX); break;
    case 7:
      request.mutable_upload_begin()->set_length(UINT64_MAX);
      request.mutable_upload_begin()->set_sha256(drawn_digest(random_));
      break;
    case 8: request.mutable_calibration_use()->set_id("no\n\x1b[31msuch calibration"); break;
    default:
      request.mutable_upload_commit()->set_sha256(drawn_digest(random_));
      request.mutable_upload_commit()->set_trial_ns(UINT64_MAX);
      break;
  }
  return request;
}

void Hostile::send_invalid_frame() {
  read_all();
  line_->write();
  wire::StreamCredit credit;
  credit.set_allowed(UINT64_MAX);
  FrameHeader header{FrameType::kRequest, 0, 0, 1};
  std::vector<std::uint8_t> bytes;
  switch (random_.below(7)) {
    case 0: bytes = frame(header, "not a message of any kind"); break;
    case 1:
      bytes = frame(header, "\x08\x01");
      bytes[20] ^= 1;  // the payload's checksum
      break;
    case 2:
      bytes = with_length(frame(header, std::string(4096, 'x')), 100'000);  // above the limit of a request
      break;
    case 3: bytes = frame({FrameType::kRequest, 0, 0, 77}, "\x08\x01"); break;
    case 4: bytes = frame({FrameType::kCredit, 0, 2, 1}, credit.SerializeAsString()); break;
    case 5: bytes = frame({FrameType::kBulk, 0, 99, 1}, std::string(600, '\xff')); break;
    default:
      bytes.resize(600);
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random_.below(256));
      break;
  }
  (void)line_->write_raw(bytes);
}

/// Most uploads are begun and not continued; some are sent completely and committed, but are not calibrations.
void Hostile::upload_junk() {
  read_all();
  if (committing_ && !line_->session().counts(uploading_)) {
    wire::Request commit;
    commit.set_id(next_id_++);
    commit.mutable_upload_commit()->set_sha256(*std::exchange(committing_, std::nullopt));
    (void)line_->session().send(commit);
  }
  wire::Request begin;
  begin.set_id(next_id_++);
  begin.mutable_upload_begin()->set_length(1U << 20);
  begin.mutable_upload_begin()->set_sha256(drawn_digest(random_));
  if (!committing_ && random_.chance(100'000)) {
    auto torn = std::make_shared<std::vector<std::uint8_t>>(torn_.begin(), torn_.end());
    if (random_.chance(500'000)) torn->resize(1 + random_.below(torn->size() / 2));
    else (*torn)[random_.below(torn->size())] = '\x1b';
    const UploadSender sender(torn);
    *begin.mutable_upload_begin() = sender.begin();
    const auto stream = line_->session().open_stream(StreamPolicy::kLossless);
    if (stream) {
      uploading_ = *stream;
      committing_ = sha256_to_wire(sender.sha256());
      (void)line_->session().offer(*stream, *sender.item(0));
      line_->session().close_stream(*stream);
    }
  }
  (void)line_->session().send(begin);
  line_->write();
}

}  // namespace nodal::swarm
