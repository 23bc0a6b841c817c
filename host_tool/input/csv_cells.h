// Rows of lists that other programs write: comma-separated values.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::host {

/// The cells of a row, without the spaces and quotes around them. A comma always separates, also between quotes.
std::vector<std::string> csv_cells(const std::string& line);

/// Errors: kBadValue if the cell is not one finite number.
Result<double> csv_number(const std::string& cell);

}  // namespace nodal::host
