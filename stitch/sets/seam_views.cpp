#include "stitch/sets/seam_views.h"

#include <array>

#include "protocol/base/try.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/prepare.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/seam_scores.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/validate.h"

namespace nodal::sets {
namespace {

constexpr bands::Grid kMap{kSeamMapWidth, kSeamMapWidth / 2};

/// Components of a view that are compared: luma, or R G B. In I420 chroma has other samples than luma.
std::size_t compared(PixelFormat format) {
  return has_chroma(format) ? 1 : static_cast<std::size_t>(component_count(format));
}

}  // namespace

Result<std::shared_ptr<const SeamViews>> SeamViews::make(const Calibration& calibration, const RaymapConfig& raymap,
                                                         std::span<const blend::BlendTable> tables) {
  const std::shared_ptr<SeamViews> made(new SeamViews);
  const PixelFormat format = in_8_bits(raymap.format);
  std::vector<PixelFormat> formats;  // as blended
  for (const blend::BlendTable::Source& source : tables[0].sources) formats.push_back(source.format);
  NODAL_TRY_ASSIGN(auto scores, table::seam_scores(calibration, formats, format, kSeamMapWidth));
  made->scores_ = std::move(scores);
  table::TableOptions options;
  options.transition = Transition::kFeather;
  options.sharpen = 0;
  options.field = tables[0].sources[0].field;
  std::vector<blend::BlendTable::Source> sources;
  for (std::size_t h = 0; h < calibration.heads.size(); ++h) {
    Calibration alone = calibration;
    alone.heads = {calibration.heads[h]};
    auto view = table::compile_blend_table(alone, {"equirectangular", kMap.width, kMap.height, format},
                                           std::span(formats).subspan(h, 1), options);
    if (!view) return fail(view.error().in("the view of head '" + calibration.heads[h].name + "' for placed seams"));
    sources.push_back(view->sources[0]);
    made->views_.push_back(std::move(*view));
  }
  for (std::size_t h = 0; h < made->views_.size(); ++h) {
    blend::BlendTable& view = made->views_[h];
    view.sources = sources;
    for (blend::GridTable& grid : view.grids) {
      for (blend::PatchRecord& record : grid.records) record.source |= static_cast<std::uint8_t>(h);
    }
    NODAL_TRY(table::validate_blend_table(view));
  }
  NODAL_TRY_ASSIGN(const auto layout, geometry::make_layout(raymap.layout, raymap.width, raymap.height));
  for (const blend::BlendTable& table : tables) {
    made->seamed_.emplace_back(table, *layout, kSeamMapWidth, raymap.seam_width_deg);
  }
  return std::shared_ptr<const SeamViews>(made);
}

SeamPictures SeamViews::empty_pictures() const {
  const blend::BlendTable& view = views_[0];
  return {0, {views_.size(), std::vector<std::uint8_t>(packed_size(view.format, view.width, view.height))}};
}

std::size_t SeamViews::scratch_size(std::size_t head) const { return blend::prepared_size(views_[head].sources[head]); }

void SeamViews::view(std::size_t head, const ImageView& picture, const blend::ToneTable& exposures,
                     std::span<const blend::ExposedHead> exposed, std::uint8_t* scratch, SeamPictures& into) const {
  const blend::BlendTable& table = views_[head];
  const std::size_t heads = table.sources.size();
  std::array<ImageView, blend::kMaxPictures> levels;
  blend::prepare_picture(table.sources[head], picture, scratch, levels);
  std::array<ImageView, kMaxHeads * blend::kMaxPictures> pictures{};
  for (std::size_t l = 0; l < table.sources[head].pictures(); ++l) pictures[l * heads + head] = levels[l];
  const blend::SetTone tone =
      exposed.empty() ? blend::calibrated_tone(table) : blend::tone_of_exposures(table, exposures, exposed);
  blend::blend_rows(table, pictures, tone,
                    packed_image(table.format, table.width, table.height, into.views[head].data()), 0, table.height);
}

seams::Labels SeamViews::place(const SeamPictures& pictures, const seams::Labels& previous) const {
  std::vector<bands::Layer> layers;
  for (std::size_t h = 0; h < views_.size(); ++h) {
    const blend::BlendTable& table = views_[h];
    const std::size_t colours = compared(table.format);
    const bool present = (pictures.heads >> h & 1) != 0;
    bands::Layer& layer =
        layers.emplace_back(kMap, present ? bands::Window::all(kMap) : bands::Window{}, static_cast<int>(colours) + 1);
    if (!present) continue;
    const ImageView view = packed_image(table.format, table.width, table.height, pictures.views[h].data());
    for (int y = 0; y < kMap.height; ++y) {
      for (int x = 0; x < kMap.width; ++x) {
        float* at = layer.at(x, y);
        for (std::size_t c = 0; c < colours; ++c) {
          const PlaneView& plane = view.planes[c];
          at[c] = plane.data[y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride];
        }
        at[colours] = scores_[h][static_cast<std::size_t>(y * kMap.width + x)];
      }
    }
  }
  return seams::place_seams(layers, previous);
}

Result<std::vector<blend::BlendTable>> SeamViews::tables(std::span<const blend::BlendTable> tables,
                                                         const seams::Labels& before,
                                                         const seams::Labels& labels) const {
  std::vector<blend::BlendTable> made;
  for (std::size_t k = 0; k < tables.size(); ++k) {
    table::SeamedTable::Moved moved = seamed_[k].with(tables[k], before, labels);
    NODAL_TRY(table::validate_tiles(moved.table, moved.made));
    made.push_back(std::move(moved.table));
  }
  return made;
}

}  // namespace nodal::sets
