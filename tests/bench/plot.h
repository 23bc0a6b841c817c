// A figure of measured points and their fitted law, as SVG for a browser.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace nodal::bench {

struct PlotPoint {
  double x = 0;
  double y = 0;
};

struct PlotSeries {
  std::string name;
  std::vector<PlotPoint> points;      ///< at least one
  std::function<double(double)> law;  ///< drawn as a line through the range of the points
  std::string law_text;
};

/// Both axes start at 0; numbers are positive.
struct Plot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::string note;                ///< below the figure: the parameters common to all points
  std::vector<PlotSeries> series;  ///< at most four
};

/// A whole SVG document.
std::string to_svg(const Plot& plot);

}  // namespace nodal::bench
