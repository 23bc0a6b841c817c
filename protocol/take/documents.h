// The two JSON documents of a take: take.json, written before the first set, and manifest, written when it has ended.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/gaps.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/take/digest.h"
#include "protocol/take/file_names.h"
#include "protocol/take/limits.h"

namespace nodal::take {

inline constexpr int kTakeVersion = 1;
inline constexpr std::size_t kMaxTakeJsonBytes = 64 * 1024;
/// The manifest of a take of a day, in segments of a minute with 16 heads, has 3 MB.
inline constexpr std::size_t kMaxManifestBytes = std::size_t{32} << 20;
/// Four times as many files as that take has.
inline constexpr std::size_t kMaxTakeFiles = 200'000;
/// Marks in one take.
inline constexpr std::size_t kMaxMarks = 10'000;
inline constexpr std::size_t kMaxMarkBytes = 200;
/// Calibrations of a take after its first one. Later ones are not stored, and the take says from which set on.
inline constexpr std::size_t kMaxCalibrations = 1000;

/// take.json.
struct TakeDocument {
  std::uint64_t number = 0;
  std::string rig;                  ///< name of the rig
  std::string software;             ///< the software that recorded the take
  std::int64_t started_utc_ns = 0;  ///< since 1970 by the board's clock; 0: unknown
  std::int64_t started_ns = 0;      ///< the same moment by the rig's monotonic clock, which times the sets; 0: unknown
  FrameRate rate;                   ///< rate when the take began; the evidence has later changes
  int raymaps_a_set = 1;            ///< 2: one per field
  std::string mode;                 ///< how heads' pictures are stored: such as "jpeg"; "driver, raw" if heads differ
  std::string calibration_id;       ///< 64 hexadecimal digits; empty: none was in force
  std::string layout;               ///< layout of the raymaps; empty: raymaps are not recorded
  int raymap_width = 0;             ///< px; 0 without raymaps
  int raymap_height = 0;
  std::vector<std::string> heads;  ///< names, by index

  /// UTC minus the rig's monotonic clock, ns; nothing if it is unknown.
  std::optional<std::int64_t> utc_offset_ns() const;
};

std::string take_json(const TakeDocument& take);
/// Errors: those of a JSON document, naming `file` and the field.
Result<TakeDocument> parse_take_json(std::string_view text, const std::string& file);

/// The manifest: its SHA-256 identifies the take.
struct Manifest {
  struct File {
    std::string name;
    std::uint64_t bytes = 0;
    Xxh128 digest{};  ///< digest_of() its pieces
    friend bool operator==(const File&, const File&) = default;
  };
  std::uint64_t number = 0;
  std::uint64_t sets = 0;          ///< number of sets in the segment's files
  std::uint64_t lost_sets = 0;     ///< sets that were lost because the disk was too slow, or by an error
  std::uint64_t deleted_sets = 0;  ///< recorded, then deleted to make room for newer ones
  Duration length;                 ///< sum of the lengths of the listed segments
  std::string ended;               ///< why: "stopped", "disk full", "recovered", ...
  /// A moment that somebody marked.
  struct Mark {
    std::uint64_t set = 0;  ///< index of the set that came next
    std::string text;
    friend bool operator==(const Mark&, const Mark&) = default;
  };
  std::vector<Mark> marks;
  /// One that was put in force after calibration.json.
  struct Calibration {
    std::string file;                              ///< "calibration-0001.json"; empty in the last: there were too many
    std::string id;                                ///< 64 hexadecimal digits
    std::uint64_t set = 0;                         ///< the rig's number of the first set that is blended with it
    bool stored() const { return !file.empty(); }  ///< false: nor is any later one, and sets from this on have none
    friend bool operator==(const Calibration&, const Calibration&) = default;
  };
  std::vector<Calibration> calibrations;  ///< sorted by `set`
  // The following fields describe what was recorded; a manifest of an older nodald has none of them.
  Gaps gaps;
  std::vector<HeadGaps> heads;    ///< by index
  std::vector<RateChange> rates;  ///< the first is that of the first set; at most kMaxRates
  std::vector<File> files;

  std::uint64_t bytes() const;
  /// Numbers of its segments, rising.
  std::vector<std::uint32_t> segments() const;
};

/// The same with what no reader accepts replaced: texts shortened and made printable, marks and rates above their
/// number left out, numbers cut to their limits.
Manifest within_limits(Manifest manifest);
std::string manifest_json(const Manifest& manifest);
/// Errors: as parse_take_json(); kBadValue for the name of a file that no take has, such as "../x".
Result<Manifest> parse_manifest(std::string_view text, const std::string& file);
/// The same for a manifest that arrives in pieces: it is never in memory as a whole.
using TextPieces = std::function<Result<std::string_view>()>;
Result<Manifest> parse_manifest(const TextPieces& text, const std::string& file);

/// Whether a calibration may come after others. Errors: kBadValue.
Status check_next(const Manifest::Calibration& calibration, std::span<const Manifest::Calibration> before);

}  // namespace nodal::take
