// The shipped programs, checked by Debian's hardening-check.
#include <gtest/gtest.h>

#include "tests/support/process.h"

namespace nodal {
namespace {

class Hardening : public testing::TestWithParam<const char*> {};

TEST_P(Hardening, PieStackProtectorFortifyRelroAndBindNow_AreAllOn) {
  // Not required: control flow integrity, which only x86 has, and stack clash, which it cannot detect in every program.
  const test::Finished check =
      test::Process({"hardening-check", "--nocfprotection", std::string(NODAL_BIN_DIR "/") + GetParam()}).wait();
  for (const char* wanted : {"Position Independent Executable: yes", "Stack protected: yes",
                             "Fortify Source functions: yes", "Read-only relocations: yes", "Immediate binding: yes"}) {
    EXPECT_NE(check.out.find(wanted), std::string::npos) << wanted << "\n" << check.out << check.err;
  }
}

INSTANTIATE_TEST_SUITE_P(Programs, Hardening, testing::Values("nodald", "nodal", "nodal-web"), [](const auto& program) {
  std::string name(program.param);
  std::erase(name, '-');
  return name;
});

}  // namespace
}  // namespace nodal
