// Reads files of takes from a rig.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"

namespace nodal::host {

/// One piece of a file: PieceHashes::kPiece bytes, fewer at the file's end.
using OnPiece = std::function<Status(std::uint64_t offset, std::span<const std::uint8_t> bytes)>;

/// Reads the file from `offset` on, a multiple of PieceHashes::kPiece, to its end. While the rig sends to another host
/// it asks again, for as long as `rig.patience()`. A rig that records sends only while its disk has time for it, so
/// this may take long; Ctrl-C ends it.
/// Errors: those of the rig and of the link, kTimeout for a rig that sends less than kMinBytesAWindow in twelve times
///   its patience, kProtocol for pieces in another order, kCancelled after Ctrl-C, and that of `on_piece`,
///   after which the rest is not fetched.
Status fetch_file(RigConnection& rig, std::uint64_t take, const std::string& file, std::uint64_t offset,
                  const OnPiece& on_piece);

/// The whole file. Errors: also kTooLarge above `limit`.
Result<std::vector<std::uint8_t>> fetch_small_file(RigConnection& rig, std::uint64_t take, const std::string& file,
                                                   std::size_t limit);

}  // namespace nodal::host
