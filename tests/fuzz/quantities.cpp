// All values on nodal's command line except file names: each parser with any text.
#include "host_tool/console/quantities.h"

#include <cstdint>
#include <cstdlib>
#include <string>

#include "host_tool/console/files.h"
#include "host_tool/input/nominal_rig.h"
#include "host_tool/rig/rig_address.h"
#include "memory_limit.h"
#include "stitch/media/raymap/raymap_file.h"

namespace {

using namespace nodal;

constexpr std::int64_t kDayNs = std::int64_t{86'400} * 1'000'000'000;  // the limit in quantities.cpp

void parse_all(const std::string& text) {
  if (const auto value = host::parse_duration(text)) {
    NODAL_ASSERT(value->ns() >= 0 && value->ns() <= kDayNs);
    NODAL_ASSERT(!host::show_duration(static_cast<std::uint64_t>(value->ns())).empty());
  }
  if (const auto value = host::parse_exposure(text)) {
    NODAL_ASSERT(value->duration().ns() > 0 && value->duration().ns() <= kDayNs);
  }
  if (const auto value = host::parse_gain(text)) {
    const auto again = host::parse_gain(host::show_gain(value->mdb()));
    // The shown text has two decimals.
    NODAL_ASSERT(!again || std::abs(std::int64_t{again->mdb()} - value->mdb()) <= 10);
  }
  if (const auto value = host::parse_white_balance(text)) NODAL_ASSERT(value->red_q12 > 0 && value->blue_q12 > 0);
  (void)host::parse_gamma(text);
  if (const auto value = host::parse_stops(text)) NODAL_ASSERT(*value <= 8000);
  if (const auto rate = host::parse_rate(text)) {
    NODAL_ASSERT(rate->numerator > 0 && rate->denominator > 0);
    // An accepted rate has increasing frame starts for any duration.
    Duration before = rate->start_of(0);
    for (const std::uint64_t frame : {std::uint64_t{1}, std::uint64_t{1} << 16, std::uint64_t{1} << 31}) {
      const Duration begin = rate->start_of(frame);
      NODAL_ASSERT(begin > before);
      before = begin;
    }
  }
  if (const auto address = host::parse_rig_address(text, "ssh"))
    NODAL_ASSERT(address->command.empty() != address->link.empty());
  if (const auto name = host::numbered_name(text, 7)) NODAL_ASSERT(name->size() <= text.size() + 100);
  (void)media::raymap_format_of_name(text);
  if (const auto nominal = host::parse_nominal(text)) {
    DecodedImage black{PixelFormat::kGrey8, 16, 12, {}};
    black.bytes.resize(packed_size(black.format, black.width, black.height));
    const std::vector<ImageView> pictures(static_cast<std::size_t>(nominal->heads), black.view());
    (void)host::nominal_rig(*nominal, pictures);  // may be refused
  }
  if (const auto circle = host::parse_circle(text)) NODAL_ASSERT(circle->radius > 1);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool limited = (nodal::fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  if (size <= 4096) parse_all(std::string(reinterpret_cast<const char*>(data), size));
  return 0;
}
