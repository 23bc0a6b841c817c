#include "stitch/offline/offline_blend.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "stitch/blend/blend.h"
#include "stitch/blend/prepare.h"
#include "stitch/geometry/head.h"
#include "stitch/parallel/workers.h"

namespace nodal::offline {
namespace {

constexpr int kBandRows = 64;  ///< raymap rows per band: the blend is fastest with multiples of 64

/// A head's picture and its pyramid, as the blend reads them.
struct Prepared {
  std::vector<std::uint8_t> memory;
  std::vector<ImageView> levels = std::vector<ImageView>(blend::kMaxPictures);
};

}  // namespace

Result<double> resolution_of(const Calibration& calibration) {
  const auto heads = geometry::make_heads(calibration);
  if (!heads) return fail(heads.error());
  double most = 0;
  for (const geometry::Head& head : *heads) {
    const Region& region = head.calibration().region;
    geometry::Pixel middle{(region.left + region.right) / 2, (region.top + region.bottom) / 2};
    if (region.circle) middle = {region.circle->x, region.circle->y};
    most = std::max(most, std::sqrt(head.density(middle)));
  }
  return most;
}

Result<OfflineBlend> OfflineBlend::make(const Calibration& calibration, const table::RaymapSpec& raymap,
                                        const table::TableOptions& options, PixelFormat head_format, int threads,
                                        const std::function<void(double)>& progress) {
  const std::vector<PixelFormat> formats(calibration.heads.size(), head_format);
  auto compiler = table::TableCompiler::make(calibration, raymap, formats, options);
  if (!compiler) return fail(compiler.error());
  const parallel::Workers workers(threads);
  const int rows = compiler->row_count();
  const int at_once = 4 * workers.threads();  // rows of tiles between two calls of progress()
  for (int done = 0; done < rows;) {
    const int until = std::min(rows, done + at_once);
    workers.run(until - done, [&](int i) { compiler->compile_rows(done + i, done + i + 1); });
    done = until;
    if (progress) progress(static_cast<double>(done) / rows);
  }
  auto table = std::move(*compiler).finish();
  if (!table) return fail(table.error());
  return OfflineBlend(std::move(*table), threads);
}

Result<DecodedImage> OfflineBlend::blend(std::span<const ImageView> pictures) const {
  const std::size_t heads = table_.sources.size();
  if (pictures.size() != heads) {
    return fail(Errc::kHeadMismatch,
                std::to_string(pictures.size()) + " pictures for " + std::to_string(heads) + " heads; give one a head");
  }
  for (std::size_t h = 0; h < heads; ++h) {
    const blend::BlendTable::Source& source = table_.sources[h];
    const ImageView& picture = pictures[h];
    if (picture.planes[0].data == nullptr) continue;
    if (picture.format != source.format || picture.width != source.width || picture.height != source.height) {
      return fail(Errc::kHeadMismatch,
                  "head " + std::to_string(h) + ": the picture has " + std::to_string(picture.width) + "x" +
                      std::to_string(picture.height) + " pixels (" + std::string(pixel_format_name(picture.format)) +
                      "), and its calibration is for " + std::to_string(source.width) + "x" +
                      std::to_string(source.height) + " (" + std::string(pixel_format_name(source.format)) + ")");
    }
  }
  const parallel::Workers workers(threads_);
  std::vector<Prepared> prepared(heads);
  workers.run(static_cast<int>(heads), [&](int i) {
    const auto h = static_cast<std::size_t>(i);
    if (pictures[h].planes[0].data == nullptr) return;
    prepared[h].memory.resize(blend::prepared_size(table_.sources[h]));
    blend::prepare_picture(table_.sources[h], pictures[h], prepared[h].memory.data(), prepared[h].levels);
  });
  std::vector<ImageView> views(heads * blend::kMaxPictures);
  for (std::size_t h = 0; h < heads; ++h) {
    for (std::size_t l = 0; l < table_.sources[h].pictures(); ++l) views[l * heads + h] = prepared[h].levels[l];
  }
  const blend::SetTone tone = blend::calibrated_tone(table_);
  DecodedImage raymap{table_.format, table_.width, table_.height, {}};
  raymap.bytes.resize(packed_size(raymap.format, raymap.width, raymap.height));
  const MutableImageView into = packed_image(raymap.format, raymap.width, raymap.height, raymap.bytes.data());
  const int bands = (raymap.height + kBandRows - 1) / kBandRows;
  workers.run(bands, [&](int band) {
    blend::blend_rows(table_, views, tone, into, band * kBandRows, std::min(raymap.height, (band + 1) * kBandRows));
  });
  return raymap;
}

}  // namespace nodal::offline
