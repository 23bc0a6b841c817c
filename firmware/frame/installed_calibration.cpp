#include "firmware/frame/installed_calibration.h"

#include <algorithm>
#include <utility>

#include "protocol/base/result.h"
#include "stitch/blend/prepare.h"

namespace nodal::firmware {

InstalledPtr make_installed(const Sha256& id, std::string name, std::vector<blend::BlendTable> tables,
                            blend::MeterTable meter, blend::ToneTable exposures) {
  NODAL_ASSERT(tables.size() == 1 || tables.size() == 2);
  std::size_t most = 0;  // the maximum, not the sum: fields are blended one after the other
  for (const blend::BlendTable& table : tables) {
    std::size_t bytes = 0;
    for (const blend::BlendTable::Source& source : table.sources) bytes += blend::prepared_size(source);
    most = std::max(most, bytes);
  }
  const blend::SetTone tone = blend::calibrated_tone(tables[0]);  // both fields have the same light
  auto prepared = std::make_shared<std::vector<std::uint8_t>>(most);
  return std::make_shared<const InstalledCalibration>(InstalledCalibration{
      id, std::move(name), std::move(tables), tone, std::move(prepared), std::move(meter), std::move(exposures)});
}

}  // namespace nodal::firmware
