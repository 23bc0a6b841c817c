// How a byte stream travels over the cable: what both ends, the rig's gadget and the host's program, agree on.
//
// A USB transfer carries one record: 8 bytes of header, at most 16376 bytes of the stream, and one byte of padding
// where the transfer would otherwise be a multiple of the packet size. Such a transfer has no short packet, so the
// receiver would wait for more, unless a packet of length zero follows it, which not every driver sends. The header's
// length alone says where a record ends: a receiver that finds two records in one transfer reads both.
//
// Each record names its session. The rig numbers sessions; a host gets the number with the answer to its control
// request, so a record of a killed host's session is recognized and is an error.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "protocol/base/result.h"

namespace nodal::hal::cable {

/// pid.codes' number for tests. A product needs its own, here and in firmware/daemon/cable.
inline constexpr std::uint16_t kVendor = 0x1209;
inline constexpr std::uint16_t kProduct = 0x0001;
/// The interface: vendor-specific, and these. They distinguish a rig from other devices with the same test number.
inline constexpr std::uint8_t kClass = 0xff;
inline constexpr std::uint8_t kSubclass = 0x4e;
inline constexpr std::uint8_t kProtocol = 0x01;

/// Control request to the interface, device to host: discards all bytes in both directions and begins a session.
/// wValue: the host's kVersion; wLength: kAnswerBytes or more.
inline constexpr std::uint8_t kOpenRequest = 0x4e;
inline constexpr std::uint8_t kOpenRequestType = 0xc1;
inline constexpr std::uint16_t kVersion = 1;

/// Buffers and transfers: what one of them holds, and how many an end keeps queued in each direction.
inline constexpr std::size_t kTransferBytes = 16384;
inline constexpr std::size_t kTransfers = 16;
inline constexpr std::size_t kHeaderBytes = 8;
inline constexpr std::size_t kMaxPayload = kTransferBytes - kHeaderBytes;
/// The smallest packet of a bulk endpoint; the others (512, 1024) are multiples.
inline constexpr std::size_t kPacketBytes = 64;

/// The answer to kOpenRequest.
struct OpenAnswer {
  std::uint16_t version = 0;  ///< the rig's
  std::uint16_t session = 0;  ///< valid if the versions are equal
  friend bool operator==(const OpenAnswer&, const OpenAnswer&) = default;
};
inline constexpr std::size_t kAnswerBytes = 8;
std::array<std::uint8_t, kAnswerBytes> write_answer(const OpenAnswer& answer);
/// Nothing if it is not a rig's answer.
std::optional<OpenAnswer> read_answer(std::span<const std::uint8_t> bytes);

/// Writes a record with as much of `payload` as fits. With an empty payload it is the session's last record.
struct WrittenRecord {
  std::size_t payload = 0;   ///< bytes taken
  std::size_t transfer = 0;  ///< bytes written
};
WrittenRecord write_record(std::uint16_t session, std::span<const std::uint8_t> payload,
                           std::span<std::uint8_t, kTransferBytes> into);

/// Takes the stream's bytes out of one session's records.
class RecordReader {
 public:
  explicit RecordReader(std::uint16_t session) : session_(session) {}

  /// Removes at least one byte from the front of `received`, which must not be empty; returns the bytes of the stream
  /// among them, possibly none. Bytes after the session's last record are removed without being read.
  /// Errors: kProtocol.
  Result<std::span<const std::uint8_t>> next(std::span<const std::uint8_t>& received);
  /// Whether the peer has ended the session.
  bool ended() const { return ended_; }

 private:
  Status read_header();

  std::uint16_t session_;
  std::array<std::uint8_t, kHeaderBytes> header_{};
  std::size_t header_bytes_ = 0;
  std::size_t payload_ = 0;  ///< bytes of the record that are still missing
  std::size_t padding_ = 0;
  bool ended_ = false;
};

}  // namespace nodal::hal::cable
