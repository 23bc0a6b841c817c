// The settings file from a disk that anything may have been written to: decode() gives settings within their limits or
// says why not, and a rig starts by them and makes raymaps. The input's first byte says whether the rest is the whole
// file, or a body that gets the head, checksum and rig.toml that decode() wants, so that more than these are tested.
#include "firmware/settings.h"

#include <algorithm>

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

void check_decoded(std::span<const std::uint8_t> file) {
  const Sha256& rig = fuzz::Stand::config().text_id;
  const auto settings = firmware::Settings::decode(file, rig);
  if (!settings) {
    NODAL_ASSERT(!settings.error().message.empty() && settings.error().message.size() < 500);
    return;
  }
  const std::string again = settings->encode(rig);
  const auto twice =
      firmware::Settings::decode(std::span(reinterpret_cast<const std::uint8_t*>(again.data()), again.size()), rig);
  NODAL_ASSERT(twice && twice->encode(rig) == again);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0 || size > 4 * firmware::kMaxSettingsBytes) return 0;
  const unsigned how = data[0];
  const std::span rest(data + 1, size - 1);
  const std::vector<std::uint8_t> file = how % 8 == 0 ? std::vector(rest.begin(), rest.end()) : file_of(rest);
  check_decoded(file);
  if (how % 4 == 3) return 0;  // a start costs a hundred times as much
  auto disk = fuzz::Stand::new_disk();
  fuzz::write_file(*disk, firmware::kSettingsFile, file);
  fuzz::Stand stand(std::move(disk));
  stand.check();
  stand.check_recovery();
  return 0;
}
