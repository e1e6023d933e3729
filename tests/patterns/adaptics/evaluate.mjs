// Evaluates cases with the npm package adaptics-pattern-evaluator: node evaluate.mjs FOLDER_OF_THE_PACKAGE CASES.json
import fs from "node:fs";

const [, , folder, input] = process.argv;
const {initSync, PatternEvaluator} = await import(`${folder}/pattern_evaluator.js`);
initSync({module: fs.readFileSync(`${folder}/pattern_evaluator_bg.wasm`)});
const geometric_transform = JSON.parse(PatternEvaluator.default_geo_transform_matrix());
const evaluated = JSON.parse(fs.readFileSync(input)).map(({pattern, user_parameters, times}) => {
    const one = new PatternEvaluator(PatternEvaluator.try_parse_into_latest_version(JSON.stringify(pattern)));
    let next = PatternEvaluator.default_next_eval_params();
    return times.map(time => {
        const asked = JSON.stringify({time, user_parameters, geometric_transform});
        const point = JSON.parse(one.eval_brush_at_anim_local_time(asked, next));
        next = JSON.stringify(point.next_eval_params);
        const {coords: {x, y, z}, intensity} = point.ul_control_point;
        return [x, y, z, intensity, point.pattern_time, Number(point.stop)];
    });
});
console.log(JSON.stringify(evaluated));
