#include "stitch/sets/installed_calibration.h"

#include <algorithm>
#include <utility>

#include "protocol/base/result.h"
#include "protocol/base/try.h"
#include "stitch/blend/prepare.h"
#include "stitch/decode/frame_decoder.h"
#include "stitch/sets/seam_views.h"

namespace nodal::sets {

InstalledPtr make_installed(const Sha256& id, std::string name, std::vector<blend::BlendTable> tables,
                            blend::MeterTable meter, blend::ToneTable exposures,
                            const std::vector<PixelFormat>& delivered, std::shared_ptr<const SeamViews> seams) {
  NODAL_ASSERT(tables.size() == 1 || tables.size() == 2);
  std::size_t most = 0;  // the maximum, not the sum: fields are blended one after the other
  for (const blend::BlendTable& table : tables) {
    std::size_t bytes = 0;
    for (const blend::BlendTable::Source& source : table.sources) bytes += blend::prepared_size(source);
    most = std::max(most, bytes);
  }
  std::shared_ptr<SeamPictures> pictures;
  if (seams) {
    pictures = std::make_shared<SeamPictures>(seams->empty_pictures());
    std::size_t bytes = 0;
    for (std::size_t h = 0; h < tables[0].sources.size(); ++h) bytes += seams->scratch_size(h);
    most = std::max(most, bytes);
  }
  const blend::SetTone tone = blend::calibrated_tone(tables[0]);  // both fields have the same light
  auto prepared = std::make_shared<std::vector<std::uint8_t>>(most);
  std::vector<std::shared_ptr<decode::FrameDecoder>> decoders;
  for (std::size_t i = 0; i < tables[0].sources.size(); ++i) {
    const blend::BlendTable::Source& source = tables[0].sources[i];
    const int rows = source.field ? 2 * source.height : source.height;  // of the whole frame
    decoders.push_back(std::make_shared<decode::FrameDecoder>(delivered.empty() ? source.format : delivered[i],
                                                              source.format, source.width, rows));
  }
  return std::make_shared<const InstalledCalibration>(InstalledCalibration{id,
                                                                           std::move(name),
                                                                           std::move(tables),
                                                                           tone,
                                                                           std::move(prepared),
                                                                           std::move(decoders),
                                                                           std::move(meter),
                                                                           std::move(exposures),
                                                                           std::move(seams),
                                                                           std::move(pictures),
                                                                           {}});
}

Result<InstalledPtr> with_seams(const InstalledCalibration& installed, std::vector<std::uint8_t> labels) {
  const SeamLabels& before = installed.seam_labels;
  NODAL_TRY_ASSIGN(auto tables,
                   installed.seams->tables(installed.tables, before ? *before : std::vector<std::uint8_t>(), labels));
  return std::make_shared<const InstalledCalibration>(InstalledCalibration{
      installed.id, installed.name, std::move(tables), installed.tone, installed.prepared, installed.decoders,
      installed.meter, installed.exposures, installed.seams, installed.seam_pictures,
      std::make_shared<const std::vector<std::uint8_t>>(std::move(labels))});
}

}  // namespace nodal::sets
