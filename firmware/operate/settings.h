// The newest settings of the rig, stored so that a start without a host restores them.
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

/// The newest value of every setting that a CaptureCommand can set. Running commands() restores the same settings. The
/// number of values is fixed, so no sequence of commands makes a file larger than kMaxSettingsBytes.
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: decode()'s.
class Settings {
 public:
  /// Records a change that was carried out.
  void remember(const CaptureCommand& change);
  /// The changes that restore the settings, in order.
  std::vector<CaptureCommand> commands() const;

  /// The settings as a file: a line with the SHA-256 of the rest, then TOML. The file names its rig.toml by SHA-256 and
  /// is not used after rig.toml is changed.
  std::string encode(const Sha256& rig_toml) const;
  /// Errors: kChecksum for a torn file; kBadFormat, kBadValue or kUnknownField for one that is no settings file;
  /// kWrongState if rig.toml was changed.
  static Result<Settings> decode(std::span<const std::uint8_t> file, const Sha256& rig_toml);
  /// A file with this TOML text and its checksum.
  static std::string with_checksum(std::string_view toml);

 private:
  using Genlock = std::variant<GenlockStart, GenlockStop>;

  std::array<std::optional<SettingsChange>, kMaxHeads> heads_;
  std::optional<Genlock> genlock_;
  std::optional<ExposureChange> exposure_;
};

}  // namespace nodal::firmware
