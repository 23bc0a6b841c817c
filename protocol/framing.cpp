#include "protocol/framing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string>

#include "protocol/base/bytes.h"
#include "protocol/base/crc32c.h"
#include "protocol/base/try.h"

namespace nodal {
namespace {

constexpr std::uint32_t kFrameMagic = 0x4C444F4E;  // "NODL"
constexpr std::size_t kCheckedHeaderBytes = kFrameHeaderBytes - 4;

}  // namespace

std::string_view frame_type_name(FrameType type) {
  switch (type) {
    case FrameType::kHello: return "hello";
    case FrameType::kRequest: return "request";
    case FrameType::kReply: return "reply";
    case FrameType::kBye: return "bye";
    case FrameType::kPing: return "ping";
    case FrameType::kPong: return "pong";
    case FrameType::kStreamOpen: return "stream-open";
    case FrameType::kBulk: return "bulk";
    case FrameType::kCredit: return "credit";
    case FrameType::kStreamStop: return "stream-stop";
    case FrameType::kStreamClose: return "stream-close";
    case FrameType::kTakeRecord: return "take-record";
  }
  return {};
}

std::size_t max_payload_bytes(FrameType type) {
  switch (type) {
    case FrameType::kRequest: return kMaxRequestBytes;
    case FrameType::kReply: return kMaxReplyBytes;
    case FrameType::kBulk: return kMaxBulkBytes;
    case FrameType::kTakeRecord: return kMaxTakeRecordBytes;
    default: return frame_type_name(type).empty() ? 0 : kMaxMessageBytes;
  }
}

std::array<std::uint8_t, kFrameHeaderBytes> encode_frame_header(const FrameHeader& header,
                                                                std::span<const std::uint8_t> payload) {
  return encode_frame_header(header, payload, {});
}

std::array<std::uint8_t, kFrameHeaderBytes> encode_frame_header(const FrameHeader& header,
                                                                std::span<const std::uint8_t> first,
                                                                std::span<const std::uint8_t> second) {
  const std::size_t length = first.size() + second.size();
  NODAL_ASSERT(length <= max_payload_bytes(header.type));
  std::array<std::uint8_t, kFrameHeaderBytes> raw{};
  ByteWriter out(raw);
  out.u32(kFrameMagic);
  out.u8(kFramingVersion);
  out.u8(static_cast<std::uint8_t>(header.type));
  out.u16(header.flags);
  out.u32(header.stream);
  out.u32(header.sequence);
  out.u32(static_cast<std::uint32_t>(length));
  out.u32(crc32c(second, crc32c(first)));
  out.u32(crc32c(std::span(raw).first(kCheckedHeaderBytes)));
  return raw;
}

tl::unexpected<Error> FrameDecoder::die(Errc code, std::string message) {
  failed_ = Error{code, std::move(message)};
  return fail(*failed_);
}

// Magic and version are checked before the header's CRC, so that a peer with another protocol or a newer framing gets
// that error, and not a checksum error.
Status FrameDecoder::check_header() {
  ByteReader in(raw_);
  if (in.u32() != kFrameMagic) {
    return die(Errc::kProtocol,
               "the bytes at a frame's beginning are not \"NODL\": the other end does not speak "
               "Nodal's protocol, or bytes were lost");
  }
  if (const unsigned version = in.u8(); version != kFramingVersion) {
    return die(
        Errc::kVersionMismatch,
        fmt::format("the other end frames by version {}, this end by version {}: use programs of the same release",
                    version, kFramingVersion));
  }
  header_.type = static_cast<FrameType>(in.u8());
  header_.flags = in.u16();
  header_.stream = in.u32();
  header_.sequence = in.u32();
  length_ = in.u32();
  payload_crc_ = in.u32();
  if (in.u32() != crc32c(std::span(raw_).first(kCheckedHeaderBytes))) {
    return die(Errc::kChecksum, "a frame's header does not match its CRC32C: the link changes bytes");
  }
  const std::string_view name = frame_type_name(header_.type);
  if (name.empty()) {
    return die(Errc::kProtocol,
               fmt::format("a frame of type {}, which this end does not know: use programs of the same release",
                           static_cast<unsigned>(header_.type)));
  }
  if (const std::size_t limit = std::min(most_, max_payload_bytes(header_.type)); length_ > limit) {
    return die(Errc::kTooLarge,
               fmt::format("a {} frame says it has {} bytes; at most {} are allowed", name, length_, limit));
  }
  if (header_.sequence != sequence_) {
    return die(Errc::kProtocol,
               fmt::format("frame {} came where frame {} was due: frames were lost, repeated or put in another order",
                           header_.sequence, sequence_));
  }
  return {};
}

Result<std::optional<WireFrame>> FrameDecoder::next(std::span<const std::uint8_t>& bytes) {
  if (failed_) return fail(*failed_);
  if (have_ < kFrameHeaderBytes) {
    const std::size_t n = std::min(kFrameHeaderBytes - have_, bytes.size());
    if (n > 0) std::memcpy(raw_.data() + have_, bytes.data(), n);
    have_ += n;
    bytes = bytes.subspan(n);
    if (have_ < kFrameHeaderBytes) return std::nullopt;
    NODAL_TRY(check_header());
  }

  std::span<const std::uint8_t> payload;
  const std::size_t done = have_ - kFrameHeaderBytes;
  if (done == 0 && bytes.size() >= length_) {  // the whole payload is here: no copy
    payload = bytes.first(length_);
    bytes = bytes.subspan(length_);
  } else {
    if (done == 0) payload_.resize(length_);
    const std::size_t n = std::min(length_ - done, bytes.size());
    if (n > 0) std::memcpy(payload_.data() + done, bytes.data(), n);
    have_ += n;
    bytes = bytes.subspan(n);
    if (have_ < kFrameHeaderBytes + length_) return std::nullopt;
    payload = std::span(payload_).first(length_);
  }
  if (crc32c(payload) != payload_crc_) {
    return die(Errc::kChecksum,
               fmt::format("the payload of {} frame {} does not match its CRC32C: the link changes bytes",
                           frame_type_name(header_.type), header_.sequence));
  }
  have_ = 0;
  ++sequence_;
  return WireFrame{header_, payload};
}

}  // namespace nodal
