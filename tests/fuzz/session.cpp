// A session whose peer sends anything, in valid frames. The input: a byte for the role and for how bytes are split,
// then frames as (type u8, stream u8, length u16, payload). A type over 0x7F is an action of the program instead: it
// opens, offers, closes, stops, or does not take its events for a while.
#include "protocol/session.h"

#include <algorithm>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "protocol/base/bytes.h"

namespace nodal {
namespace {

constexpr std::size_t kMaxBytesOfAnEvent = kMaxReplyBytes + 4096;

/// One end, its received events, and checks that they are consistent.
class Harness {
 public:
  explicit Harness(bool host) : session_(host ? Role::kHost : Role::kRig, make_hello("fuzz")) {}

  void frame(std::uint8_t type, std::uint8_t stream, std::span<const std::uint8_t> payload) {
    if (type > 0x7F) {
      act(type, stream, payload);
      return;
    }
    const auto kind = static_cast<FrameType>(type);
    if (payload.size() > max_payload_bytes(kind)) return;
    const auto header = encode_frame_header(FrameHeader{kind, 0, stream, sequence_++}, payload);
    pending_.insert(pending_.end(), header.begin(), header.end());
    pending_.insert(pending_.end(), payload.begin(), payload.end());
  }

  void deliver(std::minstd_rand* cut) {
    std::span<const std::uint8_t> bytes = pending_;
    while (!bytes.empty()) {
      const std::size_t n = cut == nullptr ? bytes.size() : std::min<std::size_t>(bytes.size(), 1 + (*cut)() % 99);
      const bool dead = session_.error() != nullptr;
      if (!dead && !session_.wants_input()) break;
      const Status status = session_.receive(bytes.first(n));
      NODAL_ASSERT(status.has_value() == (session_.error() == nullptr));
      NODAL_ASSERT(!dead || !status.has_value());  // an error is final
      bytes = bytes.subspan(n);
      if (!lazy_) take_events();
      if (dead) break;
    }
    pending_.clear();
  }

  void finish() {
    take_events();
    // Its output is bounded, and ends.
    std::size_t said = 0;
    for (auto out = session_.output(); !out.empty(); out = session_.output()) {
      said += out.size();
      session_.sent(out.size());
      NODAL_ASSERT(said < (64U << 20));
    }
    (void)session_.end_of_input();
  }

  std::vector<std::size_t> kinds;
  std::vector<std::uint8_t> pieces;
  std::optional<Error> error() const {
    return session_.error() != nullptr ? std::optional(*session_.error()) : std::nullopt;
  }

 private:
  void act(std::uint8_t type, std::uint8_t stream, std::span<const std::uint8_t> payload) {
    switch (type % 8) {
      case 0: (void)session_.open_stream(StreamPolicy::kLossless); break;
      case 1: (void)session_.open_stream(StreamPolicy::kLatest); break;
      case 2: {
        BulkItem item{std::string(payload.begin(), payload.end()), body_, 0};
        (void)session_.offer(stream, std::move(item));
        break;
      }
      case 3: session_.close_stream(stream); break;
      case 4: session_.close_stream(stream, Error{Errc::kCancelled, "fuzz"}); break;
      case 5: session_.stop_stream(stream, Error{Errc::kCancelled, "fuzz"}); break;
      case 6: lazy_ = !lazy_; break;
      default: {
        const auto out = session_.output();
        session_.sent(std::min<std::size_t>(out.size(), stream));
      }
    }
    if (const auto counts = session_.counts(stream)) {
      NODAL_ASSERT(counts->offered == counts->delivered + counts->dropped + counts->pending);
    }
  }

  void take_events() {
    while (auto event = session_.next_event()) {
      kinds.push_back(event->index());
      if (const auto* piece = std::get_if<BulkPiece>(&*event)) {
        NODAL_ASSERT(piece->offset + piece->data.size() <= piece->total);
        NODAL_ASSERT(piece->last == (piece->offset + piece->data.size() == piece->total));
        NODAL_ASSERT(piece->data.size() + piece->meta.size() < kMaxBytesOfAnEvent);
        pieces.insert(pieces.end(), piece->data.begin(), piece->data.end());
      }
      NODAL_ASSERT(!kinds.empty() && kinds.front() == 0);  // the Hello must be first
    }
  }

  Session session_;
  SharedBytes body_ = std::make_shared<const std::vector<std::uint8_t>>(100'000, std::uint8_t{7});
  std::vector<std::uint8_t> pending_;
  std::uint32_t sequence_ = 0;
  bool lazy_ = false;
};

void run(Harness& harness, std::span<const std::uint8_t> input, std::minstd_rand* cut) {
  ByteReader in(input);
  while (in.left() >= 4) {
    const std::uint8_t type = in.u8();
    const std::uint8_t stream = in.u8();
    const std::size_t length = std::min<std::size_t>(in.u16(), in.left());
    const auto payload = in.bytes(length);
    if (type > 0x7F) harness.deliver(cut);
    harness.frame(type, stream, payload);
  }
  harness.deliver(cut);
  harness.finish();
}

}  // namespace
}  // namespace nodal

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  if (size < 1) return 0;
  const bool host = (data[0] & 1) != 0;
  const std::span input(data + 1, size - 1);
  Harness whole(host), cut_up(host);
  std::minstd_rand cut(data[0] + 1U);
  run(whole, input, nullptr);
  run(cut_up, input, &cut);
  NODAL_ASSERT(whole.kinds == cut_up.kinds);
  NODAL_ASSERT(whole.pieces == cut_up.pieces);
  NODAL_ASSERT(whole.error().has_value() == cut_up.error().has_value());
  NODAL_ASSERT(!whole.error() || whole.error()->text() == cut_up.error()->text());
  return 0;
}
