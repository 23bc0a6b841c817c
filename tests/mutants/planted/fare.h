#pragma once

namespace nodal::planted {

/// A source with a gap in its tests, for the test of tests/mutants/run. Nobody is charged for a negative age.
int fare(int age);

}  // namespace nodal::planted
