#include "host_tool/input/corner_lists.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <sstream>

#include "host_tool/console/files.h"
#include "host_tool/input/csv_cells.h"
#include "host_tool/input/pictures.h"
#include "protocol/base/try.h"
#include "stitch/media/picture_bytes.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;
using calibration::CornerView;

Error wrong(Errc code, int line, const std::string& what) { return {code, fmt::format("line {}: {}", line, what)}; }

}  // namespace

Result<std::vector<CornerView>> parse_corner_list(const std::string& text) {
  std::vector<CornerView> views;
  std::vector<double> depths;  // board_z of the views
  std::istringstream in(text);
  int number = 0;
  std::size_t rows = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    if (line.find_first_not_of(" \t\r") == std::string::npos || line.front() == '#') continue;
    const std::vector<std::string> cells = csv_cells(line);
    if (cells.size() != 5 && cells.size() != 6) {
      return fail(wrong(Errc::kBadFormat, number,
                        fmt::format("{} fields; {} has five, and board_z may follow", cells.size(), kCornerColumns)));
    }
    if (rows == 0 && !csv_number(cells[1])) continue;  // the heading
    std::array<double, 5> values{};
    for (std::size_t k = 1; k < cells.size(); ++k) {
      const Result<double> value = csv_number(cells[k]);
      if (!value) return fail(value.error().in(fmt::format("line {}", number)));
      values[k - 1] = *value;
    }
    if (++rows > kMaxCorners) return fail(Errc::kTooLarge, fmt::format("more than {} corners", kMaxCorners));
    auto view = std::ranges::find(views, cells[0], &CornerView::name);
    if (view == views.end()) {
      views.push_back({cells[0], {}});
      depths.push_back(values[4]);
      view = views.end() - 1;
    }
    if (values[4] != depths[static_cast<std::size_t>(view - views.begin())]) {
      return fail(wrong(Errc::kBadValue, number,
                        "board_z differs from that of the picture's first corner; only flat "
                        "boards can be used"));
    }
    view->corners.push_back({{values[0], values[1]}, {values[2], values[3]}});
  }
  if (views.empty())
    return fail(Errc::kMissingField, fmt::format("it has no corners; its rows are {}", kCornerColumns));
  return views;
}

Result<CornerList> read_corner_list(const std::string& file) {
  NODAL_TRY_ASSIGN(const std::string text, read_file(file, kMaxCornerListBytes));
  CornerList list;
  auto views = parse_corner_list(text);
  if (!views) return fail(views.error().in(file));
  list.views = std::move(*views);
  for (const CornerView& view : list.views) {
    const std::string picture = (fs::path(file).parent_path() / view.name).string();
    NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(picture));
    NODAL_TRY_ASSIGN(const ImageHeader header, read_picture_header(bytes));
    if (list.width == 0) list.width = header.width, list.height = header.height;
    if (header.width != list.width || header.height != list.height) {
      return fail(Errc::kBadValue,
                  fmt::format("{}: has {}x{} pixels, and {} has {}x{}; photographs of one head have one "
                              "size",
                              picture, header.width, header.height, list.views.front().name, list.width, list.height));
    }
    for (const calibration::PointPair& corner : view.corners) {
      const Eigen::Vector2d& at = corner.photo;
      if (at.x() >= 0 && at.y() >= 0 && at.x() <= header.width && at.y() <= header.height) continue;
      return fail(Errc::kBadValue, fmt::format("{}: {} has a corner at {:.1f}, {:.1f}, and {}x{} pixels", file,
                                               view.name, at.x(), at.y(), header.width, header.height));
    }
  }
  return list;
}

}  // namespace nodal::host
