#include "stitch/table/made_rows.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace nodal::table {
namespace {

using blend::BlendTable;
using Made = std::array<std::array<std::vector<bool>, blend::kMaxLevels - 1>, 2>;

int height_of(const BlendTable::Source& source, std::size_t grid, int level) {
  const ImageView shape =
      packed_image(source.format, source.width, source.height, static_cast<const std::uint8_t*>(nullptr));
  return halved_chroma(shape).planes[grid].height >> level;
}

/// Marks rows [top, bottom), as far as there are.
void mark(std::vector<bool>& made, int top, int bottom) {
  for (int band = top / blend::kMadeRows; band * blend::kMadeRows < bottom && band < std::ssize(made); ++band) {
    made[static_cast<std::size_t>(band)] = true;
  }
}

/// Marks, in a plane with twice as many rows, those that show what the marked rows of this one show.
void mark_below(const std::vector<bool>& made, std::vector<bool>& larger) {
  for (int band = 0; band < std::ssize(made); ++band) {
    const int top = 2 * band * blend::kMadeRows;
    if (made[static_cast<std::size_t>(band)]) mark(larger, top, top + 2 * blend::kMadeRows);
  }
}

/// What is read of each head, by the blend and to make smaller levels.
std::vector<Made> read_of(const BlendTable& table) {
  std::vector<Made> read(table.sources.size());
  for (std::size_t h = 0; h < read.size(); ++h) {
    for (std::size_t g = 0; g < table.grids.size(); ++g) {
      for (int level = 1; level < table.sources[h].levels; ++level) {
        const int bands = (height_of(table.sources[h], g, level) + blend::kMadeRows - 1) / blend::kMadeRows;
        read[h][g][static_cast<std::size_t>(level - 1)].assign(static_cast<std::size_t>(bands), false);
      }
    }
  }
  for (const std::vector<blend::GridTable>* grids : {&table.grids, &table.cover}) {
    for (std::size_t g = 0; g < grids->size(); ++g) {
      for (const blend::PatchRecord& record : (*grids)[g].records) {
        const int level = record.pyramid_level();
        if (level == 0) continue;
        mark(read[record.head()][g][static_cast<std::size_t>(level - 1)], record.top, record.top + blend::kPatch);
      }
    }
  }
  for (std::size_t h = 0; h < read.size(); ++h) {
    for (auto level = static_cast<std::size_t>(table.sources[h].levels - 1); level >= 1; --level) {
      // The confidence in a sample of chroma is that of the luma there.
      if (table.grids.size() > 1) mark_below(read[h][1][level - 1], read[h][0][level - 1]);
      for (std::size_t g = 0; g < table.grids.size() && level > 1; ++g) {
        mark_below(read[h][g][level - 1], read[h][g][level - 2]);
      }
    }
  }
  return read;
}

}  // namespace

void name_made_rows(BlendTable& table) {
  std::vector<Made> read = read_of(table);
  for (std::size_t h = 0; h < read.size(); ++h) table.sources[h].made = std::move(read[h]);
}

bool all_read_is_made(const BlendTable& table) {
  const std::vector<Made> read = read_of(table);
  for (std::size_t h = 0; h < read.size(); ++h) {
    for (std::size_t g = 0; g < 2; ++g) {
      for (std::size_t l = 0; l + 1 < blend::kMaxLevels; ++l) {
        const std::vector<bool>&needed = read[h][g][l], &made = table.sources[h].made[g][l];
        if (made.empty()) continue;
        if (made.size() != needed.size()) return false;
        for (std::size_t k = 0; k < made.size(); ++k) {
          if (needed[k] && !made[k]) return false;
        }
      }
    }
  }
  return true;
}

}  // namespace nodal::table
