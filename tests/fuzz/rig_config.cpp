// rig.toml with hostile content: an error that names the file, or a rig within its limits.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "firmware/config/config.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  const auto config = firmware::parse_rig_config({reinterpret_cast<const char*>(data), size}, "rig.toml");
  if (!config) {
    NODAL_ASSERT(config.error().message.starts_with("rig.toml"));
    NODAL_ASSERT(config.error().message.size() < 2000);
    return 0;
  }
  NODAL_ASSERT(!config->heads.empty() && config->heads.size() <= kMaxHeads);
  NODAL_ASSERT(config->rate.numerator > 0 && config->rate.denominator > 0 && config->rate.period() > Duration());
  NODAL_ASSERT(config->raymap.width >= 16 && config->raymap.width <= 16384 && config->raymap.width % 2 == 0);
  NODAL_ASSERT(config->raymap.height >= 16 && config->raymap.height <= 16384 && config->raymap.height % 2 == 0);
  NODAL_ASSERT(config->trigger.pulse_width < config->rate.period());
  bool sim = false;
  for (const firmware::HeadConfig& head : config->heads) {
    NODAL_ASSERT(!head.name.empty() && head.name.size() <= 64 && !head.port.name.empty());
    sim |= head.port.kind == firmware::PortKind::kSim;
  }
  NODAL_ASSERT(sim == config->sim.has_value());
  return 0;
}
