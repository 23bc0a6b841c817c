// The settings file from a disk that anything may have been written to: decode() gives settings within their limits or
// says why not, and a rig starts by them. The input's first byte says what the rest is: the whole file; a body that gets
// the head, checksum and rig.toml that decode() wants; or what requests with extreme values and unknown fields are drawn
// from, which such a body holds. It also says what is done with the file, as a start costs a hundred times as much.
#include "firmware/storage/settings.h"

#include <algorithm>

#include "draw_request.h"
#include "tests/fuzz/live_heap.h"
#include "tests/fuzz/stand.h"

namespace {

using namespace nodal;

std::vector<std::uint8_t> file_of(std::span<const std::uint8_t> body) {
  // Settings without anything are the head, the checksum of what follows, and the rig.toml that they hold for.
  static const std::string empty = firmware::Settings().encode(fuzz::Stand::config().text_id);
  static const std::size_t toml_bytes = [] {
    wire::RigSettings none;
    none.set_rig_toml(sha256_to_wire(fuzz::Stand::config().text_id));
    return none.ByteSizeLong();
  }();
  const std::size_t head_bytes = empty.size() - toml_bytes - Sha256{}.size();
  std::vector<std::uint8_t> all(empty.end() - static_cast<std::ptrdiff_t>(toml_bytes), empty.end());
  all.insert(all.end(), body.begin(), body.end());
  const Sha256 checksum = sha256(all);
  all.insert(all.begin(), checksum.begin(), checksum.end());
  all.insert(all.begin(), empty.begin(), empty.begin() + static_cast<std::ptrdiff_t>(head_bytes));
  return all;
}

/// With its head, no longer than a settings file may be.
constexpr std::size_t kMostOfABody = firmware::kMaxSettingsBytes - 256;

std::vector<std::uint8_t> drawn_body(std::span<const std::uint8_t> input) {
  constexpr int kMostRequests = 64;
  ByteReader in(input);
  wire::RigSettings stored;
  for (int i = 0; i < kMostRequests && in.left() > 0; ++i) *stored.add_requests() = fuzz::draw_request(in);
  std::string body = stored.SerializePartialAsString();
  if (body.size() > kMostOfABody) body.resize(kMostOfABody);
  return {body.begin(), body.end()};
}

/// As much as known fields take: 16 heads of 54 bytes, one genlock of 30, one exposure of 60, and what wraps them.
constexpr std::size_t kMostOfKnownFields = 2048;

void check_decoded(std::span<const std::uint8_t> file) {
  const Sha256& rig = fuzz::Stand::config().text_id;
  const auto settings = firmware::Settings::decode(file, rig);
  if (!settings) {
    NODAL_ASSERT(!settings.error().message.empty() && settings.error().message.size() < 500);
    return;
  }
  const std::string again = settings->encode(rig);
  NODAL_ASSERT(again.size() <= kMostOfKnownFields);
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
  const std::vector<std::uint8_t> file = what == 0   ? std::vector(rest.begin(), rest.end())
                                         : what == 1 ? file_of(rest)
                                                     : file_of(drawn_body(rest));
  check_decoded(file);
  if (start % 4 != 0 || file.size() > firmware::kMaxSettingsBytes) return 0;
  const bool calibrated = start == 0;
  auto disk = calibrated ? fuzz::Stand::new_disk() : std::make_unique<hal::sim::SimDisk>();
  fuzz::write_file(*disk, firmware::kSettingsFile, file);
  fuzz::Stand stand(std::move(disk));
  stand.run(start % 8 == 4 ? Duration::seconds(10) : Duration::milliseconds(500));  // some faults of a rate show late
  stand.check();
  stand.check_recovery();
  return 0;
}
