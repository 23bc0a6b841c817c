#include "hal/linux/cable/records.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "protocol/base/bytes.h"
#include "protocol/base/try.h"

namespace nodal::hal::cable {
namespace {

constexpr std::uint32_t kAnswerMagic = 0x4c444e52;  // "RNDL"
constexpr std::uint16_t kRecordMagic = 0x4e43;      // "CN"

tl::unexpected<Error> broken(const std::string& how) {
  return fail(Errc::kProtocol, "a record on the cable " + how + "; both ends must run the same version of Nodal");
}

}  // namespace

std::array<std::uint8_t, kAnswerBytes> write_answer(const OpenAnswer& answer) {
  std::array<std::uint8_t, kAnswerBytes> bytes{};
  ByteWriter writer(bytes);
  writer.u32(kAnswerMagic);
  writer.u16(answer.version);
  writer.u16(answer.session);
  return bytes;
}

std::optional<OpenAnswer> read_answer(std::span<const std::uint8_t> bytes) {
  ByteReader reader(bytes);
  const bool known = reader.u32() == kAnswerMagic;
  OpenAnswer answer;
  answer.version = reader.u16();
  answer.session = reader.u16();
  if (!known || !reader.complete()) return std::nullopt;
  return answer;
}

WrittenRecord write_record(std::uint16_t session, std::span<const std::uint8_t> payload,
                           std::span<std::uint8_t, kTransferBytes> into) {
  const auto taken = payload.first(std::min(payload.size(), kMaxPayload));
  const std::size_t size = kHeaderBytes + taken.size();
  const bool padded = size % kPacketBytes == 0 && size < kTransferBytes;
  ByteWriter writer(into);
  writer.u16(kRecordMagic);
  writer.u16(session);
  writer.u16(static_cast<std::uint16_t>(taken.size()));
  writer.u16(padded ? 1 : 0);
  writer.bytes(taken);
  if (padded) writer.u8(0);
  return {taken.size(), writer.size()};
}

Status RecordReader::read_header() {
  ByteReader reader(header_);
  if (reader.u16() != kRecordMagic) return broken("has no record's first bytes");
  if (const std::uint16_t session = reader.u16(); session != session_) {
    return broken(fmt::format("is of session {}, and this is session {}", session, session_));
  }
  payload_ = reader.u16();
  padding_ = reader.u16();
  if (payload_ > kMaxPayload) {
    return broken(fmt::format("has {} bytes; at most {} are allowed", payload_, kMaxPayload));
  }
  if (padding_ > 1) return broken(fmt::format("has {} bytes of padding; at most 1 is allowed", padding_));
  ended_ = payload_ == 0;
  return {};
}

Result<std::span<const std::uint8_t>> RecordReader::next(std::span<const std::uint8_t>& received) {
  const auto take = [&](std::size_t most) {
    const auto taken = received.first(std::min(most, received.size()));
    received = received.subspan(taken.size());
    return taken;
  };
  if (ended_) {
    take(received.size());
    return std::span<const std::uint8_t>();
  }
  if (payload_ == 0 && padding_ > 0) {
    padding_ -= take(padding_).size();
    return std::span<const std::uint8_t>();
  }
  if (payload_ == 0) {
    const auto part = take(kHeaderBytes - header_bytes_);
    std::copy(part.begin(), part.end(), header_.begin() + static_cast<std::ptrdiff_t>(header_bytes_));
    header_bytes_ += part.size();
    if (header_bytes_ < kHeaderBytes) return std::span<const std::uint8_t>();
    header_bytes_ = 0;
    NODAL_TRY(read_header());
    return std::span<const std::uint8_t>();
  }
  const auto part = take(payload_);
  payload_ -= part.size();
  return part;
}

}  // namespace nodal::hal::cable
