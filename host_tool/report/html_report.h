// A report as one HTML file: text, tables, pictures and curves, all inside it, nothing from any network.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace nodal::host {

/// As text of a page or an attribute of it.
std::string html_escaped(std::string_view text);

/// A curve of a chart.
struct ChartSeries {
  std::string name;
  std::vector<std::pair<double, double>> points;
};

/// Threading: thread-bound.
/// Ownership: owns its text; pictures are copied in.
/// Errors: none; text is escaped, and values that are not finite are left out of charts.
class HtmlReport {
 public:
  /// `summary` stands below the title.
  HtmlReport(std::string_view title, std::string_view summary);

  void heading(std::string_view text);
  void paragraph(std::string_view text);
  /// A warning, shown prominently.
  void warning(std::string_view text);
  /// Cells that look like numbers stand to the right.
  void table(const std::vector<std::string>& titles, const std::vector<std::vector<std::string>>& rows);
  /// Pictures side by side, as many as fit; each a PNG or JPEG with its caption.
  void pictures(const std::vector<std::pair<std::vector<std::uint8_t>, std::string>>& files_and_captions);
  /// Curves over common axes, drawn as SVG. `log_y` needs positive values.
  void chart(std::string_view title, std::string_view x_label, std::string_view y_label,
             const std::vector<ChartSeries>& series, bool log_y = false);

  /// SVG as it is; its maker has escaped what is in it.
  void drawing(std::string_view svg);

  std::string finish() const;

 private:
  std::string title_;
  std::string body_;
};

}  // namespace nodal::host
