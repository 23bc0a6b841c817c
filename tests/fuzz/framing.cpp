// The frame decoder with any input. The first byte selects the mode: bit 0: all frame headers' CRCs and sequence
// numbers are corrected first, so that the code after those checks is reached too; other bits: how the bytes are
// split.
#include "protocol/framing.h"

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

#include "protocol/base/bytes.h"
#include "protocol/base/crc32c.h"

namespace nodal {
namespace {

constexpr std::size_t kMaxFrames = 4096;

struct Decoded {
  std::vector<FrameHeader> headers;
  std::vector<std::uint8_t> payloads;
  std::optional<Error> error;
};

Decoded decode(std::span<const std::uint8_t> bytes, std::minstd_rand* cut) {
  FrameDecoder decoder;
  Decoded all;
  while (!bytes.empty() && !all.error) {
    const std::size_t n = cut == nullptr ? bytes.size() : std::min<std::size_t>(bytes.size(), 1 + (*cut)() % 40);
    auto part = bytes.first(n);
    bytes = bytes.subspan(n);
    while (true) {
      const std::size_t before = part.size();
      const auto frame = decoder.next(part);
      NODAL_ASSERT(part.size() <= before);
      if (!frame) {
        all.error = frame.error();
        NODAL_ASSERT(!decoder.next(part).has_value());  // an error is final
        NODAL_ASSERT(!decoder.at_border());
        break;
      }
      if (!*frame) {
        NODAL_ASSERT(part.empty());  // it consumes everything, or returns a frame
        break;
      }
      NODAL_ASSERT((*frame)->payload.size() <= max_payload_bytes((*frame)->header.type));
      NODAL_ASSERT((*frame)->header.sequence == all.headers.size());
      all.headers.push_back((*frame)->header);
      all.payloads.insert(all.payloads.end(), (*frame)->payload.begin(), (*frame)->payload.end());
      NODAL_ASSERT(all.headers.size() <= kMaxFrames);
    }
  }
  return all;
}

void put_u32(std::vector<std::uint8_t>& bytes, std::size_t at, std::uint32_t value) {
  ByteWriter(std::span(bytes).subspan(at, 4)).u32(value);
}

/// Walks the frames by their lengths, and corrects sequence numbers and CRCs.
void put_right(std::vector<std::uint8_t>& bytes) {
  std::uint32_t sequence = 0;
  for (std::size_t at = 0; bytes.size() - at >= kFrameHeaderBytes;) {
    put_u32(bytes, at + 12, sequence++);
    const std::size_t length = ByteReader(std::span(bytes).subspan(at + 16, 4)).u32();
    const std::size_t present = std::min(length, bytes.size() - at - kFrameHeaderBytes);
    put_u32(bytes, at + 20, crc32c(std::span(bytes).subspan(at + kFrameHeaderBytes, present)));
    put_u32(bytes, at + 24, crc32c(std::span(bytes).subspan(at, 24)));
    at += kFrameHeaderBytes + present;
  }
}

}  // namespace
}  // namespace nodal

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  if (size < 1) return 0;
  std::vector<std::uint8_t> bytes(data + 1, data + size);
  if ((data[0] & 1) != 0) put_right(bytes);
  std::minstd_rand cut(data[0] + 1U);
  const Decoded whole = decode(bytes, nullptr);
  const Decoded pieces = decode(bytes, &cut);
  NODAL_ASSERT(whole.headers == pieces.headers);
  NODAL_ASSERT(whole.payloads == pieces.payloads);
  NODAL_ASSERT(whole.error.has_value() == pieces.error.has_value());
  NODAL_ASSERT(!whole.error || whole.error->text() == pieces.error->text());
  return 0;
}
