#include <cstdio>

#include "host_tool/command.h"
#include "host_tool/console.h"

int main(int argc, char** argv) {
  nodal::host::Console console(stdout, stderr);
  nodal::host::CommandLine line(console);
  return static_cast<int>(line.run(argc, argv));
}
