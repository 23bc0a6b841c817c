// Decodes tables and compares them with the samples from which they were made.
#include "stitch/table/tile_builder.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <random>

#include "rigs.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/table/table_compiler.h"

namespace nodal::table {
namespace {

struct Given {
  double weight = 0;
  double gain = 0;
  std::vector<std::array<double, 2>> places;  ///< positions in samples of level 0
};

/// The samples that the table gives to a pixel of grid g, by head, decoded as in blend_table.h.
std::array<Given, kMaxHeads> given(const blend::BlendTable& table, std::size_t g, int x, int y) {
  const blend::GridTable& grid = table.grids[g];
  const blend::Tile& tile = grid.tiles[grid.tile_index(x / 8, y / 8)];
  const std::size_t count = (&tile + 1)->record - tile.record;
  const int i = x % 8;
  const int j = y % 8;
  const auto p = static_cast<std::size_t>(j * 8 + i);
  const auto sum = [&](const auto& q) {
    const int terms[] = {1, i, j, i * j, i * i, j * j};
    int value = 0;
    for (std::size_t k = 0; k < q.size(); ++k) value += q[k] * terms[k];
    return value;
  };
  std::array<Given, kMaxHeads> heads;
  int left = 32768;
  for (std::size_t k = 0, number = 0; k < count; ++k, ++number) {
    const bool pair = grid.records[tile.record + k].first[1] == 0xff;
    const bool last = k + (pair ? 2 : 1) == count;
    if (pair && j >= 4) ++k;
    const std::size_t r = tile.record + k;
    if (pair && j < 4) ++k;
    const blend::PatchRecord& record = grid.records[r];
    int weight = left;
    const bool open = tile.how() == blend::Sharing::kOpen;
    if (tile.how() == blend::Sharing::kBilinear && !last) {
      const std::int16_t* q = grid.weights.data() + tile.weights() + 4 * number;
      weight = -sum(std::array<int, 4>{q[0], q[1], q[2], q[3]});
    } else if (open || (tile.how() == blend::Sharing::kListed && !last)) {
      weight = -grid.weights[tile.weights() + 64 * number + p];
    }
    left -= weight;
    if (weight == 0) continue;
    double at[2];
    for (std::size_t way = 0; way < 2; ++way) {
      const int local = record.listed() ? grid.coordinates[record.list() * 128 + 64 * way + p]
                                        : sum(way == 0 ? record.x : record.y) & 0xffff;
      // The blend truncates x to 7 bits, which loses half a unit on average.
      const double in_level = (way == 0 ? record.left : record.top) + (local - (way == 0 ? 16 : 0)) / 4096.0;
      at[way] = (in_level + 0.5) * (1 << record.pyramid_level()) - 0.5;
    }
    heads[record.head()].weight += weight / 32768.0;
    heads[record.head()].places.push_back({at[0], at[1]});
    heads[record.head()].gain = grid.gains.empty() ? 1 : sum(grid.gains[r]) / 32768.0 * table.vignetting_scale / 256.0;
  }
  return heads;
}

RC_GTEST_PROP(TileBuilder, AnyRig_TableIsWithinItsBoundsOfTheSamplesItWasMadeFrom,
              (std::uint32_t seed, bool minified)) {
  std::mt19937 random(seed);
  const Calibration rig = test::random_rig_with_light(random);
  const int width = minified ? 32 : 120;
  const auto layout = geometry::make_layout("equirectangular", width, width / 2).value();
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kYuyv);
  TableOptions options;
  options.transition = random() % 2 == 0 ? Transition::kSeam : Transition::kFeather;
  options.seam_width_deg = std::array{0.0, 1.0, 20.0}[random() % 3];
  options.feather = random() % 2 == 0 ? 0.5 : 0.05;
  const auto table = compile_blend_table(rig, *layout, PixelFormat::kI420, formats, options);
  RC_PRE(table.has_value());
  const RaySampler sampler = RaySampler::make(rig, *layout, PixelFormat::kI420, formats, options).value();
  RowSampler row(sampler);
  for (std::size_t g = 0; g < 2; ++g) {
    for (int y = 0; y < sampler.grids()[g].height; ++y) {
      row.sample(static_cast<int>(g), y);
      for (int x = 0; x < sampler.grids()[g].width; ++x) {
        const std::array<Given, kMaxHeads> got = given(*table, g, x, y);
        std::array<double, kMaxHeads> expected{};
        for (const RaySample& s : row.at(x)) {
          expected[s.head] = s.weight;
          for (const auto& at : got[s.head].places) {
            const double room = 1.0 / 16 * (1 << (table->sources[s.head].levels - 1));
            RC_ASSERT(std::abs(at[0] - s.x) <= room || s.x < 1 || s.x > rig.heads[s.head].width / 2 - 2);
            RC_ASSERT(std::abs(at[1] - s.y) <= room || s.y < 1 || s.y > rig.heads[s.head].height - 2);
            RC_ASSERT(std::abs(got[s.head].gain - s.gain) <= 0.003);
          }
        }
        double sum = 0;
        for (std::size_t h = 0; h < kMaxHeads; ++h) {
          RC_ASSERT(std::abs(got[h].weight - expected[h]) <= 3.0 / 256);
          RC_ASSERT(got[h].weight == 0 || expected[h] > 0);
          sum += got[h].weight;
        }
        RC_ASSERT(sum == (row.at(x).empty() ? 0 : 1));
      }
    }
  }
}

/// A fisheye of 200 px per radian that looks at the zenith, with a field of 1.1 rad around it.
Calibration fisheye_upwards() {
  Calibration rig;
  rig.name = "up";
  rig.heads.push_back(test::head_at("up", 700, 700, EquidistantLens{{200}}, {0, 90, 0}));
  rig.heads.back().region.circle = {350, 350, 220};
  return rig;
}

TEST(TileBuilder, StepsOfTwoAndAHalfSamplesAlongMeridians_TakeHalvesAlsoWhereCirclesOfLatitudeAreShort) {
  // A row down is 200 pi / 256 = 2.45 samples; a column along is 2.45 a, with a the angle from the zenith.
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8};
  const auto layout = geometry::make_layout("equirectangular", 512, 256).value();
  const auto table = compile_blend_table(fisheye_upwards(), *layout, PixelFormat::kGrey8, formats);
  ASSERT_TRUE(table.has_value());
  for (const blend::PatchRecord& record : table->grids[0].records) EXPECT_EQ(record.pyramid_level(), 1);
  EXPECT_EQ(table->sources[0].sharpen, 0);  // not sharpened: no detail is lost
}

TEST(TileBuilder, StepsOfAWholeSampleAndAHalf_TakeThePictureItself) {
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8};  // 200 pi / 400 = 1.57
  const auto layout = geometry::make_layout("equirectangular", 800, 400).value();
  const auto table = compile_blend_table(fisheye_upwards(), *layout, PixelFormat::kGrey8, formats);
  ASSERT_TRUE(table.has_value());
  for (const blend::PatchRecord& record : table->grids[0].records) EXPECT_EQ(record.pyramid_level(), 0);
  EXPECT_EQ(table->sources[0].sharpen, TableOptions().sharpen);
}

TEST(TileBuilder, TilesTurnedBy45Degrees_TakeAPairWhereAPatchIsTooSmall) {
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8};
  struct Case {
    int width;
    bool paired;
  };
  for (const Case& of : {Case{960, false}, Case{768, true}}) {  // 13.0; 16.2 samples
    const auto layout = geometry::make_layout("equirectangular", of.width, of.width / 2).value();
    const auto table = compile_blend_table(test::turned_fisheyes({0}), *layout, PixelFormat::kGrey8, formats);
    ASSERT_TRUE(table.has_value());
    const blend::GridTable& grid = table->grids[0];
    for (int row = of.width / 32 - 3; row < of.width / 32 + 3;
         ++row) {  // near the axis, where s is the same everywhere
      for (int column = of.width / 16 - 3; column < of.width / 16 + 3; ++column) {
        const std::size_t t = grid.tile_index(column, row);
        const std::size_t first = grid.tiles[t].record;
        ASSERT_EQ(grid.tiles[t + 1].record - first, of.paired ? 2U : 1U);
        EXPECT_EQ(grid.tiles[t].how(), blend::Sharing::kAlone);
        EXPECT_EQ(grid.records[first].paired(), of.paired);
      }
    }
  }
}

TEST(TileBuilder, TilesThatAnEdgeOfAFaceCrosses_TakeThePictureItself) {
  // Pixels of sqrt(4 pi / (908 681)) rad = 0.90 samples. Faces are 227 pixels wide, so that edges cross tiles, and the
  // step over an edge may be any number of samples.
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8};
  const auto layout = geometry::make_layout("healpix", 908, 681).value();
  const auto table = compile_blend_table(fisheye_upwards(), *layout, PixelFormat::kGrey8, formats);
  ASSERT_TRUE(table.has_value());
  for (const blend::PatchRecord& record : table->grids[0].records) EXPECT_EQ(record.pyramid_level(), 0);
  EXPECT_EQ(table->sources[0].levels, 1);
}

/// The number of parts of a tile whose neighbouring pixels have rays closer than `most`, rad. Only rays up to `reach`
/// rad from the front count.
int connected_parts(const geometry::RaymapLayout& layout, int left, int top, double most, double reach) {
  std::array<std::optional<geometry::Ray>, 64> rays;
  for (int p = 0; p < 64; ++p) {
    const auto ray = layout.ray(left + p % 8 + 0.5, top + p / 8 + 0.5);
    if (ray && ray->direction().z() > std::cos(reach)) rays[static_cast<std::size_t>(p)] = ray;
  }
  std::array<bool, 64> seen{};
  const auto visit = [&](auto self, int x, int y) -> void {
    const auto p = static_cast<std::size_t>(8 * y + x);
    seen[p] = true;
    for (int j = std::max(0, y - 1); j <= std::min(7, y + 1); ++j) {
      for (int i = std::max(0, x - 1); i <= std::min(7, x + 1); ++i) {
        const auto q = static_cast<std::size_t>(8 * j + i);
        if (!seen[q] && rays[q] && (rays[p]->direction() - rays[q]->direction()).norm() < most) self(self, i, j);
      }
    }
  };
  int parts = 0;
  for (int p = 0; p < 64; ++p) {
    const auto k = static_cast<std::size_t>(p);
    if (!rays[k] || seen[k]) continue;
    ++parts;
    visit(visit, p % 8, p / 8);
  }
  return parts;
}

TEST(TileBuilder, TilesWithPixelsOfSeveralFaces_HaveOnePatchForEach) {
  // One head that sees up to 1.9 rad from the front. Pixels are 0.4 to 1.1 samples, so that 8x8 of them fit into a
  // patch.
  Calibration rig;
  rig.name = "all";
  rig.heads.push_back(test::head_at("all", 1200, 1200, EquidistantLens{{100}}, {0, 0, 0}));
  rig.heads.back().region.circle = {600, 600, 190};
  const auto layout = geometry::make_layout("icosahedron", 1200, 416).value();
  TableOptions options;
  options.transition = Transition::kFeather;
  options.undo_vignetting = false;
  const std::vector<PixelFormat> formats{PixelFormat::kGrey8};
  const auto table = compile_blend_table(rig, *layout, PixelFormat::kGrey8, formats, options);
  ASSERT_TRUE(table.has_value());
  const blend::GridTable& grid = table->grids[0];
  std::size_t parts = 0;
  for (int y = 0; y + 8 <= 416; y += 8) {
    for (int x = 0; x + 8 <= 1200; x += 8) {
      parts += static_cast<std::size_t>(connected_parts(*layout, x, y, 0.02, 1.9));
    }
  }
  EXPECT_EQ(grid.records.size(), parts);
}

TEST(FitQuadratic, ValuesOfAQuadratic_GiveItBack) {
  const std::array<std::int32_t, 6> truth{1000, -300, 700, 11, -23, 5};
  PixelValues values;
  for (int p = 0; p < 64; ++p) {
    const int i = p % 8, j = p / 8;
    values[static_cast<std::size_t>(p)] =
        truth[0] + truth[1] * i + truth[2] * j + truth[3] * i * j + truth[4] * i * i + truth[5] * j * j;
  }
  EXPECT_EQ(fit_quadratic(values, ~PixelMask{0}), truth);
  const auto half = fit_quadratic(values, 0x0f0f0f0f0f0f0f0f);  // half of them give the same fit, up to rounding
  for (int p = 0; p < 64; ++p) {
    const int i = p % 8, j = p / 8;
    if (i > 3) continue;
    const int at = half[0] + half[1] * i + half[2] * j + half[3] * i * j + half[4] * i * i + half[5] * j * j;
    EXPECT_NEAR(at, values[static_cast<std::size_t>(p)], 4);
  }
}

TEST(FitBilinear, RoundedCoefficients_MakeUpForEachOther) {
  PixelValues values;
  for (int p = 0; p < 64; ++p) values[static_cast<std::size_t>(p)] = 20000 + p % 8 * (p / 8) / 2;  // half an ij
  const auto fit = fit_bilinear(values, ~PixelMask{0});
  for (int p = 0; p < 64; ++p) {
    const int i = p % 8, j = p / 8;
    // Truncating each coefficient separately would give an error of 24 in the corner.
    EXPECT_NEAR(fit[0] + fit[1] * i + fit[2] * j + fit[3] * i * j, 20000 + i * j / 2.0, 9);
  }
}

}  // namespace
}  // namespace nodal::table
