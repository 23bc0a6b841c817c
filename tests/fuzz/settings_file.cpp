// The settings file from a disk with any content: decode() returns settings within their limits or the reason for
// refusal, and a rig starts with them. The input's first byte selects the rest's meaning: the whole file; a text that
// gets the checksum and rig.toml that decode() requires; or a source from which such a text with extreme values is
// drawn. It also selects the use of the file, because a start costs a hundred times as much.
#include <algorithm>
#include <array>

#include "firmware/operate/settings.h"
#include "firmware/storage/settings_store.h"
#include "tests/fuzz/live_heap.h"
#include "tests/fuzz/stand.h"
#include "tests/fuzz/telling.h"

namespace {

using namespace nodal;

std::vector<std::uint8_t> file_of(std::string_view text) {
  const std::string file = firmware::Settings::with_checksum("rig_toml = \"" + to_hex(fuzz::Stand::config().text_id) +
                                                             "\"\n" + std::string(text));
  return {file.begin(), file.end()};
}

/// Including its first line, at most the maximum length of a settings file.
constexpr std::size_t kMaxOfAText = firmware::kMaxSettingsBytes - 256;

std::string drawn_value(ByteReader& in) {
  constexpr std::array kWords{"\"manual\"", "\"each\"", "\"joint\"", "true",   "false", "-1",   "0",         "15",
                              "16",         "1.5",      "nan",       "[1, 2]", "{}",    "\"\"", "1979-05-27"};
  const unsigned kind = in.u8();
  if (kind % 2 == 0) return kWords[kind / 2 % kWords.size()];
  return (kind % 4 == 1 ? "" : "-") + std::to_string(fuzz::telling(in, kind % 8 < 4 ? 63 : 17));
}

/// A running genlock with a rate that is allowed, nearly allowed, or has terms that overflow.
std::string drawn_genlock(ByteReader& in) {
  const fuzz::DrawnRate rate = fuzz::drawn_terms(in);
  return "[genlock]\nrunning = true\nrate_numerator = " + std::to_string(rate.numerator) +
         "\nrate_denominator = " + std::to_string(rate.denominator) + "\n";
}

/// Tables and keys of settings in any order, some twice, some in the wrong table or in none.
std::string drawn_text(ByteReader& in) {
  constexpr std::array kTables{"[genlock]", "[exposure]", "[[heads]]", "[heads]", "[other]"};
  constexpr std::array kKeys{"running",  "rate_numerator", "rate_denominator", "pulse_width_ns",
                             "program",  "anchor",         "target",           "difference",
                             "ramp",     "longest_ns",     "highest_gain_mdb", "locked",
                             "index",    "exposure_ns",    "gain_mdb",         "red_q12",
                             "blue_q12", "gamma",          "rig_toml",         "other"};
  std::string text;
  while (in.left() > 0 && text.size() < kMaxOfAText - 100) {
    const unsigned what = in.u8();
    const unsigned table = what / 4 % (kTables.size() + 1);
    if (what % 4 == 0) text += table < kTables.size() ? std::string(kTables[table]) + "\n" : drawn_genlock(in);
    else text += std::string(kKeys[what / 4 % kKeys.size()]) + " = " + drawn_value(in) + "\n";
  }
  return text;
}

std::string drawn(std::span<const std::uint8_t> input) {
  ByteReader in(input);
  return drawn_text(in);
}

/// The size of all fields together (SettingsSize.EveryFieldAtItsLargest_IsFarBelowTheLimit).
constexpr std::size_t kMaxOfAllFields = firmware::kMaxSettingsBytes / 8;

void check_decoded(std::span<const std::uint8_t> file) {
  const Sha256& rig = fuzz::Stand::config().text_id;
  const auto settings = firmware::Settings::decode(file, rig);
  if (!settings) {
    NODAL_ASSERT(!settings.error().message.empty() && settings.error().message.size() < 1000);
    return;
  }
  const std::string again = settings->encode(rig);
  NODAL_ASSERT(again.size() <= kMaxOfAllFields);
  const auto twice =
      firmware::Settings::decode(std::span(reinterpret_cast<const std::uint8_t*>(again.data()), again.size()), rig);
  NODAL_ASSERT(twice && twice->encode(rig) == again);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool kept = (fuzz::keep_freed_memory(), true);
  (void)kept;
  if (size == 0 || size > 4 * firmware::kMaxSettingsBytes) return 0;
  const unsigned what = data[0] % 4, start = data[0] / 4;
  const std::span rest(data + 1, size - 1);
  const std::vector<std::uint8_t> file = what == 0 ? std::vector(rest.begin(), rest.end())
                                         : what == 1
                                             ? file_of({reinterpret_cast<const char*>(rest.data()), rest.size()})
                                             : file_of(drawn(rest));
  check_decoded(file);
  if (start % 4 != 0 || file.size() > firmware::kMaxSettingsBytes) return 0;
  const bool calibrated = start == 0;
  auto disk = calibrated ? fuzz::Stand::new_disk() : std::make_unique<hal::sim::SimDisk>();
  fuzz::write_file(*disk, firmware::kSettingsFile, file);
  fuzz::Stand stand(std::move(disk));
  stand.run(start % 8 == 4 ? Duration::seconds(10) : Duration::milliseconds(500));  // some faults of a rate appear late
  stand.check();
  stand.check_recovery();
  return 0;
}
