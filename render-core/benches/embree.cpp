// Traces the rays of benches/rays.rs with Embree 3 on one thread and prints million rays per second. The benchmark
// compiles and starts this program.
//
// Usage: embree FILE. The file has two 32-bit counts, then triangles (nine floats each), then rays by type: a count, and
// (origin, direction, length) of each ray. The types are primary, shadow and diffuse. Shadow rays search for any hit.

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <vector>
#include <embree3/rtcore.h>

struct Ray { float origin[3], direction[3], length; };

template <class T> static T *read(FILE *file, std::vector<T> &out, size_t count) {
    out.resize(count);
    if (fread(out.data(), sizeof(T), count, file) != count) { fprintf(stderr, "the file ends early\n"); exit(1); }
    return out.data();
}

// Returns rays per second, the best of five runs.
template <class F> static double rate(size_t count, F &&trace) {
    double best = 0;
    for (int k = 0; k < 5; ++k) {
        const auto start = std::chrono::steady_clock::now();
        trace();
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
        best = std::max(best, count / took.count());
    }
    return best;
}

int main(int, char **argv) {
    FILE *file = fopen(argv[1], "rb");
    std::vector<uint32_t> head;
    const uint32_t triangles = read(file, head, 2)[0], kinds = head[1];
    std::vector<float> corners;
    read(file, corners, size_t(triangles) * 9);

    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *vertices = rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, triangles * 3);
    memcpy(vertices, corners.data(), corners.size() * sizeof(float));
    auto *indices = static_cast<uint32_t *>(
        rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles));
    for (uint32_t i = 0; i < triangles * 3; ++i) indices[i] = i;
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);

    for (uint32_t kind = 0; kind < kinds; ++kind) {
        std::vector<uint32_t> count;
        std::vector<Ray> rays;
        read(file, count, 1);
        read(file, rays, count[0]);
        const bool any = kind == 1, coherent = kind != 2;
        size_t hits = 0;
        RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        context.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
        const double single = rate(rays.size(), [&] {
            hits = 0;
            for (const Ray &ray : rays) {
                RTCRayHit query{};
                memcpy(&query.ray.org_x, ray.origin, 12);
                memcpy(&query.ray.dir_x, ray.direction, 12);
                query.ray.tfar = ray.length;
                query.ray.mask = -1;
                query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
                if (any) { rtcOccluded1(scene, &context, &query.ray); hits += query.ray.tfar < 0; }
                else { rtcIntersect1(scene, &context, &query); hits += query.hit.geomID != RTC_INVALID_GEOMETRY_ID; }
            }
        });
        const double packets = rate(rays.size(), [&] {
            for (size_t first = 0; first < rays.size(); first += 16) {
                alignas(64) RTCRayHit16 query;
                alignas(64) int valid[16];
                for (size_t i = 0; i < 16; ++i) {
                    valid[i] = first + i < rays.size() ? -1 : 0;
                    const Ray &ray = rays[valid[i] ? first + i : 0];
                    query.ray.org_x[i] = ray.origin[0]; query.ray.dir_x[i] = ray.direction[0];
                    query.ray.org_y[i] = ray.origin[1]; query.ray.dir_y[i] = ray.direction[1];
                    query.ray.org_z[i] = ray.origin[2]; query.ray.dir_z[i] = ray.direction[2];
                    query.ray.tnear[i] = 0; query.ray.tfar[i] = ray.length;
                    query.ray.time[i] = 0; query.ray.mask[i] = -1; query.ray.flags[i] = 0;
                    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID; query.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
                }
                if (any) rtcOccluded16(valid, scene, &context, &query.ray);
                else rtcIntersect16(valid, scene, &context, &query);
            }
        });
        static const char *names[] = {"primary", "shadow", "diffuse"};
        printf("embree %-8s %6.2f Mray/s alone, %6.2f in packets of 16; %zu of %zu rays meet something\n", names[kind],
               single * 1e-6, packets * 1e-6, hits, rays.size());
    }
}
