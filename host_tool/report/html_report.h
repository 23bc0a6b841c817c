// A report as one HTML file: text, tables, pictures and curves, all embedded, without network access.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace nodal::host {

/// Escapes text for use in a page or an attribute.
std::string html_escaped(std::string_view text);

/// A curve of a chart.
struct ChartSeries {
  std::string name;
  std::vector<std::pair<double, double>> points;
};

/// Threading: thread-bound.
/// Ownership: owns its text; pictures are copied.
/// Errors: none; text is escaped, and values that are not finite are left out of charts.
class HtmlReport {
 public:
  /// `summary` is shown below the title. Without a title: the contents of details().
  HtmlReport(std::string_view title, std::string_view summary);

  void heading(std::string_view text);
  void paragraph(std::string_view text);
  /// A warning, shown prominently.
  void warning(std::string_view text);
  /// Cells that look like numbers are right-aligned.
  void table(const std::vector<std::string>& titles, const std::vector<std::vector<std::string>>& rows);
  /// Pictures side by side, as many as fit; each is a PNG or JPEG with its caption.
  void pictures(const std::vector<std::pair<std::vector<std::uint8_t>, std::string>>& files_and_captions);
  /// An equirectangular picture of a sphere, or of a part of it, which people can turn. `part`: left edge, top, width
  /// and height, as shares of the whole sphere. Without WebGL the page shows the flat picture.
  void sphere(std::span<const std::uint8_t> file, std::string_view caption, const std::array<double, 4>& part);
  /// Curves over common axes, drawn as SVG. `log_y` needs positive values.
  void chart(std::string_view title, std::string_view x_label, std::string_view y_label,
             const std::vector<ChartSeries>& series, bool log_y = false);

  /// Unmodified SVG; the caller must have escaped its text.
  void drawing(std::string_view svg);
  /// The contents of another page, which are not shown until the title is clicked.
  void details(std::string_view title, const HtmlReport& page);

  std::string finish() const;

 private:
  std::string title_;
  std::string body_;
  bool has_sphere_ = false;
};

}  // namespace nodal::host
