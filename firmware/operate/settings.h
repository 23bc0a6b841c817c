// What the rig was told to be like, so that a rig that starts again without a host is as it was.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/capture/capture.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"

namespace nodal::firmware {

/// The newest value of everything that a CaptureChange can set. Making commands() again makes the same settings. It has a
/// fixed number of values, so no sequence of commands makes a file larger than kMaxSettingsBytes.
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: decode()'s.
class Settings {
 public:
  /// Takes note of a change that was carried out.
  void remember(const CaptureChange& change);
  /// To be made again, in this order.
  std::vector<CaptureChange> commands() const;

  /// As a file: TOML, after a line with the SHA-256 of what follows. They hold for this rig.toml, and are not used any
  /// more when it is changed.
  std::string encode(const Sha256& rig_toml) const;
  /// Errors: kChecksum when the file is torn, kBadFormat, kBadValue or kUnknownField when it is none, kWrongState when
  /// rig.toml is another.
  static Result<Settings> decode(std::span<const std::uint8_t> file, const Sha256& rig_toml);
  /// A file of this text, which decode() takes when the text is right.
  static std::string with_checksum(std::string_view toml);

 private:
  using Genlock = std::variant<GenlockStart, GenlockStop>;

  std::array<std::optional<SettingsChange>, kMaxHeads> heads_;
  std::optional<Genlock> genlock_;
  std::optional<ExposureChange> exposure_;
};

}  // namespace nodal::firmware
