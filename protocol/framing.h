// Frames over a byte stream: 28 bytes of header, then the payload. All numbers little-endian.
//
//   0  u32  magic "NODL"          16  u32  payload length
//   4  u8   framing version, 1    20  u32  CRC32C of the payload
//   5  u8   type                  24  u32  CRC32C of bytes 0..23
//   6  u16  flags
//   8  u32  stream, 0 for control
//  12  u32  sequence: counts this direction's frames from 0, so that a lost or repeated one is seen
//
// A header that does not hold together is an error before its length is believed, and a length over its
// type's limit is an error before a byte is allocated. After an error a byte stream has no borders left:
// the decoder stays failed, and the link is to be dropped.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal {

enum class FrameType : std::uint8_t {
  kHello = 1,         ///< wire::Hello; the first frame each way, and only that
  kRequest = 2,       ///< wire::Request
  kReply = 3,         ///< wire::Reply
  kBye = 4,           ///< wire::Error: the last frame of an end that gives up, and why
  kPing = 5,          ///< empty; the other end answers with kPong. From protocol 2 on
  kPong = 6,          ///< empty
  kStreamOpen = 16,   ///< wire::StreamOpen
  kBulk = 17,         ///< a piece of an item; see bulk.h
  kCredit = 18,       ///< wire::StreamCredit
  kStreamStop = 19,   ///< wire::StreamStop: the receiver wants no more
  kStreamClose = 20,  ///< wire::StreamClose: the sender's last word on a stream
};

/// "bulk", or nothing when nobody knows the type.
std::string_view frame_type_name(FrameType type);

inline constexpr std::uint8_t kFramingVersion = 1;
inline constexpr std::size_t kFrameHeaderBytes = 28;
/// A reply may hold one calibration document and what is around it.
inline constexpr std::size_t kMaxReplyBytes = (1U << 20) + (1U << 14);
/// Of a reply without what is in its calibration document: see reply_size.h. The longest is the audit log, 256 entries of
/// five texts of 240 bytes.
inline constexpr std::size_t kMaxListReplyBytes = 384U << 10;
inline constexpr std::size_t kMaxRequestBytes = 64U << 10;
/// Of every other message. Small, because a message in memory can be tens of times what it was on the wire.
inline constexpr std::size_t kMaxMessageBytes = 8U << 10;
/// A bulk frame's payload, its piece header included.
inline constexpr std::size_t kMaxBulkBytes = 64U << 10;

struct FrameHeader {
  FrameType type = FrameType::kRequest;
  std::uint16_t flags = 0;
  std::uint32_t stream = 0;
  std::uint32_t sequence = 0;
  friend bool operator==(const FrameHeader&, const FrameHeader&) = default;
};

/// The longest payload a frame of this type may have; 0 for unknown types.
std::size_t max_payload_bytes(FrameType type);

/// The header that goes before `payload`.
std::array<std::uint8_t, kFrameHeaderBytes> encode_frame_header(const FrameHeader& header,
                                                                std::span<const std::uint8_t> payload);
/// The same for a payload that lies in two places; crc32c(second, crc32c(first)) is its CRC.
std::array<std::uint8_t, kFrameHeaderBytes> encode_frame_header(const FrameHeader& header,
                                                                std::span<const std::uint8_t> first,
                                                                std::span<const std::uint8_t> second);

/// One whole, checked frame.
struct WireFrame {
  FrameHeader header;
  std::span<const std::uint8_t> payload;
};

/// Cuts a byte stream back into frames, however it arrives.
///
/// Threading: thread-bound.
/// Ownership: a WireFrame is valid until the next call, and while the bytes given to next() are.
/// Errors: kProtocol (bad magic, unknown type, sequence), kChecksum, kTooLarge, kVersionMismatch. The first
///   is final: every later call gives it again.
class FrameDecoder {
 public:
  /// Takes bytes off the front of `bytes` until one frame is whole or none are left. Call until it gives
  /// nothing.
  Result<std::optional<WireFrame>> next(std::span<const std::uint8_t>& bytes);

  /// Whether the stream may end here: no frame is half there.
  bool at_border() const { return !failed_ && have_ == 0; }
  /// Bytes of the frame under way that have arrived, header included.
  std::size_t under_way() const { return have_; }
  /// Whole frames so far.
  std::uint32_t frames() const { return sequence_; }

 private:
  Status check_header();
  tl::unexpected<Error> die(Errc code, std::string message);

  std::array<std::uint8_t, kFrameHeaderBytes> raw_{};  // the header under way
  std::size_t have_ = 0;                               // bytes of header and payload so far
  FrameHeader header_;
  std::size_t length_ = 0;
  std::uint32_t payload_crc_ = 0;
  std::vector<std::uint8_t> payload_;  // only frames that arrive in parts go through here
  std::uint32_t sequence_ = 0;         // of the next frame
  std::optional<Error> failed_;
};

}  // namespace nodal
