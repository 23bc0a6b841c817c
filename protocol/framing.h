// Frames over a byte stream: 28 bytes of header, then the payload. All numbers little-endian.
//
//   0  u32  magic "NODL"          16  u32  payload length
//   4  u8   framing version, 1    20  u32  CRC32C of the payload
//   5  u8   type                  24  u32  CRC32C of bytes 0..23
//   6  u16  flags
//   8  u32  stream, 0 for control
//  12  u32  sequence: counts this direction's frames from 0, so that a lost or repeated frame is detected
//
// An inconsistent header is an error before its length is used; a length above the limit of its type is an error before
// memory is allocated. After an error the frame borders of the stream are unknown, so the decoder stays failed, and the
// link must be dropped.
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
  kHello = 1,         ///< wire::Hello; the first frame in each direction, and only that
  kRequest = 2,       ///< wire::Request
  kReply = 3,         ///< wire::Reply
  kBye = 4,           ///< wire::Error: an end gives up; its last frame, with the reason
  kPing = 5,          ///< empty; the other end answers with kPong. Since protocol 2
  kPong = 6,          ///< empty
  kStreamOpen = 16,   ///< wire::StreamOpen
  kBulk = 17,         ///< a piece of an item; see bulk.h
  kCredit = 18,       ///< wire::StreamCredit
  kStreamStop = 19,   ///< wire::StreamStop: the receiver wants no more items
  kStreamClose = 20,  ///< wire::StreamClose: the sender has finished the stream
  kTakeRecord = 64,   ///< a record of a take's evidence; in files only, a session refuses it
};

/// For example "bulk"; empty for an unknown type.
std::string_view frame_type_name(FrameType type);

inline constexpr std::uint8_t kFramingVersion = 1;
inline constexpr std::size_t kFrameHeaderBytes = 28;
/// A reply may contain one calibration document and some other fields.
inline constexpr std::size_t kMaxReplyBytes = (1U << 20) + (1U << 14);
/// The limit of a reply without its calibration document: see reply_size.h. The longest is the audit log, 256 entries
/// of five texts of 240 bytes.
inline constexpr std::size_t kMaxListReplyBytes = 384U << 10;
inline constexpr std::size_t kMaxRequestBytes = 64U << 10;
/// The limit of every other message. Small, because a message in memory can be tens of times larger than on the wire.
inline constexpr std::size_t kMaxMessageBytes = 8U << 10;
/// The limit of a record of evidence: one with 16 heads has less than 4 KiB, one with the hashes of a cluster row less
/// than 8.
inline constexpr std::size_t kMaxTakeRecordBytes = 64U << 10;
/// The limit of a bulk frame's payload, including its piece header.
inline constexpr std::size_t kMaxBulkBytes = 64U << 10;
static_assert(kMaxBulkBytes <= kMaxRequestBytes, "a rig takes frames of up to kMaxRequestBytes");

struct FrameHeader {
  FrameType type = FrameType::kRequest;
  std::uint16_t flags = 0;
  std::uint32_t stream = 0;
  std::uint32_t sequence = 0;
  friend bool operator==(const FrameHeader&, const FrameHeader&) = default;
};

/// The longest payload a frame of this type may have; 0 for unknown types.
std::size_t max_payload_bytes(FrameType type);

/// The header for `payload`.
std::array<std::uint8_t, kFrameHeaderBytes> encode_frame_header(const FrameHeader& header,
                                                                std::span<const std::uint8_t> payload);
/// The same for a payload in two parts; its CRC is crc32c(second, crc32c(first)).
std::array<std::uint8_t, kFrameHeaderBytes> encode_frame_header(const FrameHeader& header,
                                                                std::span<const std::uint8_t> first,
                                                                std::span<const std::uint8_t> second);

/// One complete, checked frame.
struct WireFrame {
  FrameHeader header;
  std::span<const std::uint8_t> payload;
};

/// Splits a byte stream into frames; bytes may arrive in pieces of any size.
///
/// Threading: thread-bound.
/// Ownership: a WireFrame is valid until the next call, and only while the bytes given to next() are.
/// Errors: kProtocol (bad magic, unknown type, sequence), kChecksum, kTooLarge, kVersionMismatch. The first error is
///   final: every later call returns it again.
class FrameDecoder {
 public:
  /// `most`: the longest payload of any type that this end takes. A rig takes no replies, so its hosts cannot make it
  /// keep kMaxReplyBytes of one.
  explicit FrameDecoder(std::size_t most = kMaxReplyBytes) : most_(most) {}

  /// Consumes bytes from the front of `bytes` until one frame is complete or no bytes are left. Call it until it
  /// returns nothing.
  Result<std::optional<WireFrame>> next(std::span<const std::uint8_t>& bytes);

  /// Whether the stream may end here: no frame is incomplete.
  bool at_border() const { return !failed_ && have_ == 0; }
  /// Received bytes of the incomplete frame, including its header.
  std::size_t under_way() const { return have_; }
  /// The header of the incomplete frame; null while it is incomplete itself.
  const FrameHeader* header_under_way() const { return have_ >= kFrameHeaderBytes ? &header_ : nullptr; }
  /// Number of complete frames.
  std::uint32_t frames() const { return sequence_; }

 private:
  Status check_header();
  tl::unexpected<Error> die(Errc code, std::string message);

  std::size_t most_;
  std::array<std::uint8_t, kFrameHeaderBytes> raw_{};  // header of the incomplete frame
  std::size_t have_ = 0;                               // number of bytes received of the frame's header and payload
  FrameHeader header_;
  std::size_t length_ = 0;
  std::uint32_t payload_crc_ = 0;
  std::vector<std::uint8_t> payload_;  // only for frames that arrive in parts
  std::uint32_t sequence_ = 0;         // number of the next frame
  std::optional<Error> failed_;
};

}  // namespace nodal
