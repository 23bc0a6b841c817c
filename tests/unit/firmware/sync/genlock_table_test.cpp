#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "firmware/sync/genlock.h"

namespace nodal::firmware {
namespace {

/// The first table of "/// | a | b |" lines in a file.
struct TextTable {
  std::vector<std::string> columns;  ///< without the first column
  std::vector<std::vector<std::string>> rows;
};

TextTable table_in(const std::string& file) {
  TextTable table;
  std::ifstream text(file);
  for (std::string line; std::getline(text, line);) {
    if (!line.starts_with("/// |")) {
      if (!table.columns.empty()) break;
      continue;
    }
    if (line.starts_with("/// |-")) continue;
    std::vector<std::string> cells;
    std::istringstream parts(line.substr(5));
    for (std::string cell; std::getline(parts, cell, '|');) {
      const std::size_t from = cell.find_first_not_of(' ');
      cells.push_back(from == std::string::npos ? "" : cell.substr(from, cell.find_last_not_of(' ') - from + 1));
    }
    if (table.columns.empty()) table.columns.assign(cells.begin() + 1, cells.end());
    else table.rows.push_back(cells);
  }
  return table;
}

TEST(GenlockWithoutPort, Start_SaysSo) {
  Genlock none(nullptr);
  const Status started = none.start({}, Instant());
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error().code, Errc::kNoSuchDevice);
  EXPECT_EQ(none.state(), GenlockState::kOff);
}

/// The table must match the one in the comment of genlock.h.
TEST(GenlockTable, EveryStateAndCondition_IsAsItsHeaderSays) {
  const TextTable table = table_in(NODAL_SOURCE_DIR "/firmware/sync/genlock.h");
  ASSERT_EQ(table.rows.size(), kGenlockConditions);
  ASSERT_EQ(table.columns.size(), 5u);
  for (std::size_t row = 0; row < table.rows.size(); ++row) {
    const auto condition = static_cast<GenlockCondition>(row);
    EXPECT_EQ(table.rows[row].front(), genlock_condition_name(condition));
    for (std::size_t column = 0; column < table.columns.size(); ++column) {
      const auto state = static_cast<GenlockState>(column);
      EXPECT_EQ(table.columns[column], genlock_state_name(state));
      EXPECT_EQ(table.rows[row].at(column + 1), genlock_state_name(genlock_after(state, condition)))
          << genlock_condition_name(condition) << " in " << genlock_state_name(state);
    }
  }
}

}  // namespace
}  // namespace nodal::firmware
