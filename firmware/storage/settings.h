// What hosts have set, so that a rig that starts again without a host is set as it was.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/nodal.pb.h"

namespace nodal::firmware {

/// The requests that made the settings, the newest of each: one a head, one for the genlock, one for the exposure
/// program. Making the same requests again makes the same settings. Only fields that this program knows are kept, of at
/// most kMaxHeads heads, so no sequence of requests makes a file larger than kMaxSettingsBytes.
///
/// Threading: thread-bound to control.
/// Ownership: none.
/// Errors: decode()'s.
class Settings {
 public:
  /// Takes note of a request that was carried out. `heads` is how many the rig has. True when it is one that is kept.
  bool remember(const wire::Request& request, std::size_t heads);
  /// To be made again, in this order.
  std::vector<wire::Request> requests() const;

  /// As a file: they hold for this rig.toml, and are forgotten when it is changed, since then it has the newest word.
  std::string encode(const Sha256& rig_toml) const;
  /// Errors: kChecksum when the file is torn, kBadFormat when it is none, kWrongState when rig.toml is another.
  static Result<Settings> decode(std::span<const std::uint8_t> file, const Sha256& rig_toml);

 private:
  std::vector<wire::Request> kept() const;

  std::map<std::uint32_t, wire::HeadSetRequest> heads_;
  std::optional<wire::GenlockRequest> genlock_;
  std::optional<wire::ExposureRequest> exposure_;
};

/// In the root of the store's disk.
inline const std::string kSettingsFile = "settings";
inline constexpr std::uint64_t kMaxSettingsBytes = 64 * 1024;

}  // namespace nodal::firmware
