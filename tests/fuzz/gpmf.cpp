// GoPro's telemetry, as films of unknown origin hold it.
#include <cstddef>
#include <cstdint>

#include "memory_limit.h"
#include "protocol/base/result.h"
#include "stitch/media/gpmf/gyro.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool limited = (nodal::fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  const std::span<const std::uint8_t> bytes(data, size);
  if (const auto samples = nodal::media::read_gyro(bytes)) NODAL_ASSERT(samples->rates.size() <= size / 6);
  const nodal::media::TimedPayload payloads[] = {
      {0, 1, bytes}, {1, 1, bytes.first(size / 2)}, {2, 1, bytes}, {3, 1, bytes}};
  if (const auto gyro = nodal::media::read_gyro(payloads)) {
    NODAL_ASSERT(gyro->times.size() == gyro->speeds.size());
    for (std::size_t i = 1; i < gyro->times.size(); ++i) NODAL_ASSERT(gyro->times[i] > gyro->times[i - 1]);
  }
  return 0;
}
