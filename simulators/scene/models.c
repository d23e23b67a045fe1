/* Models of single objects. Lengths are mm of the real one: x to its front, y up from the ground, z to its left. */
#include "simulators/scene/scene_internal.h"

struct model {
    struct sst_scene_world *w;
    struct sst_vec3 base, front, left;
    double scale;
};

static struct model model_at(struct sst_scene_world *w, struct stand at)
{
    return (struct model){ .w = w,
                           .base = at.base,
                           .front = vec3(cos(at.yaw), 0, -sin(at.yaw)),
                           .left = vec3(sin(at.yaw), 0, cos(at.yaw)),
                           .scale = at.scale };
}

static struct sst_vec3 at(const struct model *m, double x, double y, double z)
{
    struct sst_vec3 p = vec3_add(vec3_mul(m->front, x), vec3_mul(m->left, z));

    p.y -= y;
    return vec3_add(m->base, vec3_mul(p, m->scale));
}

static struct sst_scene_surface *ball(const struct model *m, struct sst_vec3 c, struct sst_vec3 r,
                                      struct sst_scene_material mat)
{
    const double k = m->scale;

    return add_ellipsoid(
        m->w, c, (struct axes){ vec3_mul(m->front, r.x * k), vec3(0, r.y * k, 0), vec3_mul(m->left, r.z * k) }, mat);
}

static void limb(const struct model *m, struct sst_vec3 p, struct sst_vec3 q, double r, struct sst_scene_material mat)
{
    add_limb(m->w, p, q, r * m->scale, mat);
}

static void bar(const struct model *m, struct sst_vec3 p, struct sst_vec3 q, double half, struct sst_scene_material mat)
{
    add_bar(m->w, p, q, half * m->scale, mat);
}

static void box(const struct model *m, struct sst_vec3 c, struct sst_vec3 half, struct sst_scene_material mat)
{
    const double k = m->scale;

    /* Equal from the left and the right: the first axis runs along the picture. */
    add_box(m->w, c,
            (struct axes){ vec3_mul(m->front, half.x * k), vec3(0, half.y * k, 0), vec3_mul(m->left, half.z * k) },
            mat);
}

/* tyre: inner radius of the tyre around a disc, of the outer one; 0: thin rim with spokes. */
static void wheel(const struct model *m, struct sst_vec3 c, double radius, double tyre)
{
    struct sst_scene_material rubber = material(paint_wheel, 0x1d1d20, 0xa9adb3, 60 * m->scale);
    struct sst_scene_surface *s;

    s = sst_scene_add_patch(m->w, c, vec3_mul(m->front, radius * m->scale), vec3(0, radius * m->scale, 0), rubber);
    s->mask = mask_wheel;
    s->outline = tyre;
}

/* --- animals ------------------------------------------------------------------------------------------------------ */

void add_horse(struct sst_scene_world *w, struct stand stand)
{
    const struct model m = model_at(w, stand);
    const struct sst_scene_material coat = material(paint_fur, 0x6e4326, 0xa66c40, 160 * m.scale);
    const struct sst_scene_material mane = material(paint_fur, 0x1f1510, 0x4b3526, 120 * m.scale);
    const struct sst_scene_material white = material(sst_scene_paint_fbm, 0xcfc6b8, 0xf0ebe2, 120 * m.scale);

    limb(&m, at(&m, -430, 1190, 0), at(&m, 420, 1190, 0), 270, coat);
    ball(&m, at(&m, -480, 1230, 0), vec3(330, 300, 260), coat);
    ball(&m, at(&m, 430, 1200, 0), vec3(300, 310, 245), coat);
    limb(&m, at(&m, 470, 1290, 0), at(&m, 760, 1640, 0), 190, coat);
    limb(&m, at(&m, 640, 1500, 0), at(&m, 860, 1880, 0), 140, coat);
    limb(&m, at(&m, 840, 1900, 0), at(&m, 1190, 1640, 0), 108, coat);
    ball(&m, at(&m, 1195, 1640, 0), vec3(85, 85, 75), white);
    ball(&m, at(&m, 960, 1850, -92), vec3(28, 24, 16), mane);
    limb(&m, at(&m, 850, 1960, -50), at(&m, 880, 2110, -70), 32, coat);
    limb(&m, at(&m, 850, 1960, 50), at(&m, 880, 2110, 70), 32, coat);
    limb(&m, at(&m, 380, 1520, 0), at(&m, 780, 2000, 0), 75, mane);
    limb(&m, at(&m, -770, 1330, 0), at(&m, -960, 620, 0), 85, mane);
    for (int i = 0; i < 4; i++) {
        const double x = i & 2 ? 500 : -560, z = i & 1 ? 150 : -150, step = (i == 1 || i == 2) ? 130 : -60;

        limb(&m, at(&m, x, 1150, z), at(&m, x + step, 600, z), i & 2 ? 105 : 135, coat);
        limb(&m, at(&m, x + step, 640, z), at(&m, x + 0.7 * step - 50, 150, z), 66, coat);
        limb(&m, at(&m, x + 0.7 * step - 50, 190, z), at(&m, x + 0.7 * step, 60, z), 62, white);
        ball(&m, at(&m, x + 0.7 * step + 25, 45, z), vec3(95, 60, 80), mane);
    }
}

void add_cat(struct sst_scene_world *w, struct stand stand)
{
    const struct model m = model_at(w, stand);
    const struct sst_scene_material coat = {
        paint_fur, rgb_hex(0x9c5a24), rgb_hex(0xd89a56), 34 * m.scale, 0.32, NULL
    };
    const struct sst_scene_material belly = material(paint_fur, 0xc9a678, 0xf0dcba, 30 * m.scale);
    const struct sst_scene_material eye = material(sst_scene_paint_fbm, 0x2c4a1a, 0x8fb04a, 8 * m.scale);
    const struct sst_scene_material dark = material(sst_scene_paint_fbm, 0x18110e, 0x3a2a22, 10 * m.scale);

    limb(&m, at(&m, -130, 175, 0), at(&m, 120, 200, 0), 92, coat);
    ball(&m, at(&m, -140, 150, 0), vec3(125, 130, 95), coat);
    ball(&m, at(&m, 130, 190, 0), vec3(90, 115, 82), coat);
    ball(&m, at(&m, 150, 130, -10), vec3(70, 70, 78), belly);
    ball(&m, at(&m, 215, 325, -15), vec3(84, 76, 80), coat);
    ball(&m, at(&m, 262, 302, -55), vec3(36, 28, 36), belly);
    limb(&m, at(&m, 175, 370, -55), at(&m, 165, 432, -70), 28, coat);
    limb(&m, at(&m, 245, 375, 25), at(&m, 255, 436, 35), 28, coat);
    ball(&m, at(&m, 218, 342, -88), vec3(17, 15, 10), eye);
    ball(&m, at(&m, 272, 342, -58), vec3(15, 15, 14), eye);
    ball(&m, at(&m, 218, 342, -95), vec3(5, 13, 6), dark);
    ball(&m, at(&m, 276, 342, -70), vec3(5, 13, 6), dark);
    ball(&m, at(&m, 282, 312, -82), vec3(12, 9, 9), dark);
    limb(&m, at(&m, -230, 120, 0), at(&m, -390, 90, -30), 32, coat);
    limb(&m, at(&m, -370, 90, -30), at(&m, -460, 230, -30), 27, coat);
    for (int side = -1; side <= 1; side += 2) {
        limb(&m, at(&m, 150, 150, side * 45), at(&m, 165, 30, side * 45), 34, coat);
        ball(&m, at(&m, 185, 20, side * 45), vec3(46, 24, 32), belly);
        ball(&m, at(&m, -120, 100, side * 60), vec3(95, 98, 42), coat);
        ball(&m, at(&m, -70, 20, side * 65), vec3(80, 24, 32), belly);
    }
}

void add_hen(struct sst_scene_world *w, struct stand stand)
{
    const struct model m = model_at(w, stand);
    const struct sst_scene_material feather = material(paint_feather, 0x8a4c20, 0xd79a58, 30 * m.scale);
    const struct sst_scene_material dark = material(paint_feather, 0x3a2618, 0x8a5a30, 34 * m.scale);
    const struct sst_scene_material red = material(sst_scene_paint_fbm, 0xa01c18, 0xd8473a, 12 * m.scale);
    const struct sst_scene_material horn = material(sst_scene_paint_fbm, 0xb8862c, 0xe8c060, 12 * m.scale);
    const struct sst_scene_material eye = material(sst_scene_paint_fbm, 0x100c0a, 0x3a2a1a, 6 * m.scale);

    ball(&m, at(&m, 0, 205, 0), vec3(165, 118, 98), feather);
    ball(&m, at(&m, 85, 235, 0), vec3(95, 112, 82), feather);
    limb(&m, at(&m, 110, 290, 0), at(&m, 160, 395, 0), 56, feather);
    ball(&m, at(&m, 170, 410, 0), vec3(50, 46, 42), feather);
    limb(&m, at(&m, 212, 408, 0), at(&m, 246, 398, 0), 15, horn);
    ball(&m, at(&m, 190, 418, -36), vec3(9, 9, 8), eye);
    for (int i = 0; i < 3; i++)
        ball(&m, at(&m, 150 + 24 * i, 458 + (i == 1 ? 8 : 0), 0), vec3(15, 24, 9), red);
    ball(&m, at(&m, 208, 370, 0), vec3(12, 26, 10), red);
    for (int i = 0; i < 4; i++)
        limb(&m, at(&m, -110, 235, 0), at(&m, -205 - 12 * i, 300 + 34 * i, 16 * i - 24), 36, dark);
    ball(&m, at(&m, -25, 210, -82), vec3(115, 72, 26), dark);
    for (int side = -1; side <= 1; side += 2) {
        limb(&m, at(&m, 10, 120, side * 40), at(&m, 15, 70, side * 40), 30, feather);
        bar(&m, at(&m, 15, 90, side * 40), at(&m, 15, 8, side * 40), 9, horn);
        bar(&m, at(&m, -15, 8, side * 40), at(&m, 55, 8, side * 40), 8, horn);
    }
}

/* --- vehicles ----------------------------------------------------------------------------------------------------- */

void add_bicycle(struct sst_scene_world *w, struct stand stand)
{
    const struct model m = model_at(w, stand);
    const struct sst_scene_material frame = material(sst_scene_paint_fbm, 0x0f5f6b, 0x3fa6a8, 60 * m.scale);
    const struct sst_scene_material black = material(sst_scene_paint_fbm, 0x18181b, 0x4a4a50, 40 * m.scale);
    const struct sst_scene_material steel = material(sst_scene_paint_fbm, 0x84888e, 0xd0d4da, 40 * m.scale);
    const struct sst_vec3 rear = at(&m, -520, 345, 0), front = at(&m, 540, 345, 0), crank = at(&m, -60, 300, 0);
    const struct sst_vec3 seat = at(&m, -195, 830, 0), head = at(&m, 370, 880, 0), low = at(&m, 400, 740, 0);
    struct sst_scene_surface *ring;

    wheel(&m, rear, 345, 0);
    wheel(&m, front, 345, 0);
    bar(&m, crank, seat, 21, frame);
    bar(&m, seat, head, 20, frame);
    bar(&m, crank, low, 23, frame);
    bar(&m, head, low, 24, frame);
    bar(&m, low, front, 17, steel);
    bar(&m, crank, rear, 14, frame);
    bar(&m, seat, rear, 13, frame);
    bar(&m, seat, at(&m, -225, 930, 0), 15, steel);
    ball(&m, at(&m, -220, 950, 0), vec3(145, 32, 70), black);
    bar(&m, head, at(&m, 355, 1000, 0), 15, steel);
    for (int side = -1; side <= 1; side += 2) {
        limb(&m, at(&m, 355, 1000, 0), at(&m, 400, 1020, side * 270), 17, steel);
        limb(&m, at(&m, 400, 1020, side * 270), at(&m, 290, 1010, side * 290), 24, black);
        limb(&m, crank, at(&m, -60 + side * 150, 300 - side * 80, side * 60), 15, steel);
        ball(&m, at(&m, -60 + side * 160, 300 - side * 85, side * 90), vec3(55, 14, 40), black);
    }
    ring =
        sst_scene_add_patch(w, at(&m, -60, 300, -30), vec3_mul(m.front, 95 * m.scale), vec3(0, 95 * m.scale, 0), steel);
    ring->mask = mask_disc;
}

void add_motorcycle(struct sst_scene_world *w, struct stand stand)
{
    const struct model m = model_at(w, stand);
    const struct sst_scene_material red = material(sst_scene_paint_fbm, 0x8e1414, 0xd6402e, 260 * m.scale);
    const struct sst_scene_material black = material(sst_scene_paint_fbm, 0x17171a, 0x4c4c52, 90 * m.scale);
    const struct sst_scene_material steel = material(sst_scene_paint_fbm, 0x70757c, 0xd4d8de, 90 * m.scale);
    const struct sst_scene_material cream = material(sst_scene_paint_fbm, 0xcfc4a0, 0xf2ead0, 120 * m.scale);

    wheel(&m, at(&m, -700, 310, 0), 310, 0.68);
    wheel(&m, at(&m, 760, 310, 0), 310, 0.68);
    ball(&m, at(&m, 20, 440, 0), vec3(270, 220, 150), black);
    for (int i = 0; i < 5; i++) /* cooling fins */
        box(&m, at(&m, 60, 500 + 45 * i, 0), vec3(150, 13, 150), steel);
    ball(&m, at(&m, -60, 330, -90), vec3(130, 120, 60), steel);
    ball(&m, at(&m, 160, 850, 0), vec3(330, 140, 130), red);
    ball(&m, at(&m, 160, 850, -100), vec3(150, 60, 42), cream);
    limb(&m, at(&m, -560, 790, 0), at(&m, -110, 790, 0), 85, black);
    ball(&m, at(&m, -720, 690, 0), vec3(250, 85, 95), red);
    ball(&m, at(&m, 770, 640, 0), vec3(230, 60, 80), red);
    for (int side = -1; side <= 1; side += 2) {
        bar(&m, at(&m, 760, 310, side * 75), at(&m, 520, 1000, side * 75), 32, steel);
        bar(&m, at(&m, -700, 310, side * 80), at(&m, -60, 420, side * 80), 35, black);
        bar(&m, at(&m, -640, 330, side * 85), at(&m, -480, 740, side * 85), 30, steel);
        limb(&m, at(&m, 500, 1010, 0), at(&m, 400, 1080, side * 360), 24, steel);
        limb(&m, at(&m, 400, 1080, side * 360), at(&m, 290, 1060, side * 390), 34, black);
    }
    bar(&m, at(&m, 180, 330, -130), at(&m, -330, 230, -140), 38, steel);
    limb(&m, at(&m, -300, 230, -150), at(&m, -940, 330, -150), 62, steel);
    ball(&m, at(&m, 640, 920, 0), vec3(110, 115, 110), cream);
    ball(&m, at(&m, -960, 720, 0), vec3(40, 45, 60), red);
}

static void add_humvee_wheels(const struct model *m)
{
    const struct sst_scene_material rubber = material(sst_scene_paint_fbm, 0x161616, 0x444240, 120 * m->scale);

    for (int i = 0; i < 4; i++) {
        const double x = i & 2 ? 1500 : -1500, z = i & 1 ? 900 : -900;

        ball(m, at(m, x, 470, z), vec3(470, 470, 160), rubber);
        wheel(m, at(m, x, 470, z * 1.19), 400, 0.62);
    }
}

void add_humvee(struct sst_scene_world *w, struct stand stand)
{
    const struct model m = model_at(w, stand);
    const struct sst_scene_material paint = material(paint_camouflage, 0x8c8458, 0x5a6238, 700 * m.scale);
    const struct sst_scene_material glass = material(sst_scene_paint_fbm, 0x1a242c, 0x6f8694, 400 * m.scale);
    const struct sst_scene_material dark = material(sst_scene_paint_fbm, 0x222420, 0x55584c, 200 * m.scale);

    add_humvee_wheels(&m);
    box(&m, at(&m, 0, 820, 0), vec3(2250, 260, 1000), paint);
    box(&m, at(&m, 1500, 1180, 0), vec3(700, 120, 900), paint);
    box(&m, at(&m, -350, 1420, 0), vec3(1050, 380, 950), paint);
    box(&m, at(&m, -1800, 1250, 0), vec3(420, 180, 970), paint);
    for (int i = 0; i < 2; i++) {
        const double x = i ? 190 : -850;

        box(&m, at(&m, x, 1500, 0), vec3(360, 200, 965), glass);
        box(&m, at(&m, x + 330, 1060, 0), vec3(25, 40, 975), dark);
    }
    box(&m, at(&m, 700, 1520, 0), vec3(16, 200, 800), glass);
    box(&m, at(&m, 2270, 860, 0), vec3(40, 180, 850), dark);
    box(&m, at(&m, 2300, 600, 0), vec3(60, 70, 950), dark);
    ball(&m, at(&m, 2260, 1010, 620), vec3(70, 110, 110), glass);
    ball(&m, at(&m, 2260, 1010, -620), vec3(70, 110, 110), glass);
    add_limb(w, at(&m, -300, 1960, 0), at(&m, 900, 2010, 0), 55 * m.scale, dark);
    box(&m, at(&m, -350, 1850, 0), vec3(350, 60, 350), dark);
    add_bar(w, at(&m, -2050, 1400, -800), at(&m, -2150, 3000, -800), 16 * m.scale, dark);
}
