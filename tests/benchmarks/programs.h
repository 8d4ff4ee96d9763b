/// @file programs.h
/// The benchmarks that `supple_bench` holds. Each is the main function of a program of that name.
#pragma once

namespace supple::benchmarks::programs {

int contact_bench(int argc, char** argv);
int contact_bodies(int argc, char** argv);
int contact_calibration(int argc, char** argv);
int contact_conservation(int argc, char** argv);
int contact_invariance(int argc, char** argv);
int contact_pile(int argc, char** argv);
int contact_poses(int argc, char** argv);
int contact_rules(int argc, char** argv);
int contact_several(int argc, char** argv);
int contact_stress(int argc, char** argv);
int contact_thin(int argc, char** argv);
int core_bench(int argc, char** argv);
int core_stress(int argc, char** argv);
int field_bench(int argc, char** argv);
int fit_bench(int argc, char** argv);
int integrator_bench(int argc, char** argv);
int mesh_bench(int argc, char** argv);
int mesh_probes(int argc, char** argv);
int partition_bench(int argc, char** argv);
int render_bench(int argc, char** argv);
int scene_bench(int argc, char** argv);

}  // namespace supple::benchmarks::programs
